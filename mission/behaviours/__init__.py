"""One module per behaviour: what a state of a mission may do."""

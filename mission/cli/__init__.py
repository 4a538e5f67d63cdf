"""One module per command of `mission`."""

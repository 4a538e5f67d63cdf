"""Campaigns of whole flights: blade angles, wind, faults. `make campaign`; too long for `make test`."""

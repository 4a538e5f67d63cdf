"""Photons to knowledge: camera model, dots, stereo, edges, tip, far view and tracker. Pure functions of arrays."""

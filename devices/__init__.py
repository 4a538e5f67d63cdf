"""The rig: cameras, laser, range finder; recorded rigs; the simulated world."""

"""The simulated turbine, its surroundings, and what cameras, laser and range finder see of them."""

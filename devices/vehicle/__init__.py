"""The simulated vehicle: flight dynamics, an autopilot like PX4, and MAVLink."""

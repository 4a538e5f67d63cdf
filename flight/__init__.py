"""Knowledge to motion: frames of reference, guidance, gimbal, autopilot link and pre-flight checks."""

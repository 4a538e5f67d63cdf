"""Where to fly and look, from what is known of the blade: the thesis's equations 5.2 to 5.26 and their composition.
Pure."""

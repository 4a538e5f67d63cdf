"""Speed and accuracy of the eye, measured: `make bench`."""

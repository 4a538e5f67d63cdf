"""Mission files: typed, checked line by line, proven and drawn."""

"""A mission as a picture: what its parts are, where they stand on the page, and how they are drawn."""

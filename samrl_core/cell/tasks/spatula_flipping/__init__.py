"""Spatula flipping: a pancake is pushed against a lip, lifted on a blade and turned over."""

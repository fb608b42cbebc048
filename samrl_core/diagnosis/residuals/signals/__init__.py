"""Sampled signals: bands, noise and its colour, filters, rounding, stamps."""

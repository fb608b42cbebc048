"""Tracks of free bodies as residuals: phases, segments, impacts."""

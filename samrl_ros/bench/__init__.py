"""Measurements: `samrl bench NAME`."""

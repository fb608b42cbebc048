"""Simpler ways to name the cause of a gap, one per file, scored on the same recordings."""

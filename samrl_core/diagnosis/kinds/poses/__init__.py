"""Poses of a target in a camera: how they are diagnosed, what is corrected by them, what to record next."""

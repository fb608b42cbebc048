"""Tracks of free bodies: how they are diagnosed, what is weighed against effects, what to record next."""

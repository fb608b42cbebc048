"""Scores of a blind test: sealed labels against the diagnosis, and baselines beside it."""

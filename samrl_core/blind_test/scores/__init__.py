"""Scores of a blind test: sealed labels against what the diagnosis said, and baselines beside it."""

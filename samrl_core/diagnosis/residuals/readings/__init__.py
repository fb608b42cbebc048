"""Readings of one quantity against its reference as residuals."""

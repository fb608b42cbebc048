"""Readings against a reference: how they are diagnosed, and what is corrected by them."""

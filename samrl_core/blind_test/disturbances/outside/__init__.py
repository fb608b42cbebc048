"""Disturbances that no catalogue lists: a diagnosis ought to refuse a name."""

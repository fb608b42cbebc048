"""Disturbances that no catalogue lists: a diagnosis ought to say that it knows none of them."""

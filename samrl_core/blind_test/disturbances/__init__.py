"""Disturbances of an arm, one family per file; `registry` lists them."""

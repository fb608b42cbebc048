"""Kinds of recordings: what each brings to the one diagnosis."""

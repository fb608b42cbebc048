"""Needle threading: the end of a limp thread goes down through the eye of a needle."""

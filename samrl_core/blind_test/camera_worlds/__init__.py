"""Worlds of a cell's camera: cell instances in which one cause at most is larger than a good installation's.

The simulated world draws the images with its own renderer. Nothing of the diagnosis is imported here but by
`bench`, which compares what it says with the truth.
"""

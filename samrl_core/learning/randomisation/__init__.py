"""Guided randomisation: what differs between model and cell, as distributions, and strategies to choose them.

A strategy asks for points of a space to be tried, and makes its next distribution of what came out. Uniform
asks nothing. Automatic domain randomisation widens where the actor still succeeds at a boundary. SimOpt moves
a Gaussian to where the model does what the cell was observed to do. SAM-RL's own way begins at the states
that Real2Sim estimated.
"""

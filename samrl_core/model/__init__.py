"""The differentiable model of the cell: RGB-XYZ renderer (NVIDIA Warp behind torch) and its scene."""

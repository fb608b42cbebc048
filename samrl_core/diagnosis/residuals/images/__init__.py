"""Images against the model rendered at the nominal calibration: depth, outlines and colour, tile by tile."""

"""Effects that images show: of the camera, of clocks, of light, of where bases and objects stand."""

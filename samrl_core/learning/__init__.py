"""Learning in the model: data, networks, regression, weights. Knows no world and no ROS."""

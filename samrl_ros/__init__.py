"""The ROS 2 side of the cell: nodes, topics, bags and the command line. Importing it needs no ROS."""

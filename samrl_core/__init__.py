"""The model, Real2Sim, robots, tasks and the stand-in world. Nothing in here imports ROS."""

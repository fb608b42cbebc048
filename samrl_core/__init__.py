"""The model, Real2Sim, robots, tasks and the simulated cell. Nothing in here imports ROS."""

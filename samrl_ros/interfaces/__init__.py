"""Builds the project's own ROS interfaces with the wheels' generators and gcc: no CMake, no colcon."""

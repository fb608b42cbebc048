"""Bags: rosbag2-compatible MCAP files, written and read without ROS installed."""

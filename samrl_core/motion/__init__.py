"""Jerk-limited motion and the rules by which trajectories are refused."""

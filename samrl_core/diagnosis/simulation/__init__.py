"""Arm dynamics: rigid-body model of any fixed-base URDF and its differentiable closed-loop simulator."""

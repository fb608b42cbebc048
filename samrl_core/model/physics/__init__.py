"""Differentiable rigid bodies, joints and contact."""

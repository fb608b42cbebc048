"""Warp kernels of the closed loop: one step of controller, drive, friction, rigid arm, and its adjoint."""

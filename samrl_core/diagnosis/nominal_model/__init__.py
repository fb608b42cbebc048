"""The nominal model as users have it: URDF, xacro or MJCF in, one form out."""

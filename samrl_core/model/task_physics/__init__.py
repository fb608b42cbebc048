"""The tasks' physics: bodies, joints and contacts built from a task's scene, behind one border to plan with."""

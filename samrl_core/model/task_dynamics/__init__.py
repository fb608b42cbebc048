"""The tasks' physics, built from their scenes, behind one border to plan with."""

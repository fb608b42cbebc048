"""Physical parameters from motion (paper eqs. 9-11): mass and friction of what the arm has pushed."""

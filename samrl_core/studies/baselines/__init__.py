"""What the learners that the paper compares with train on. Needs the extra `baselines`."""

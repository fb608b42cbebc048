"""Studies of one part of the system at a time; they may read the truth, the parts may not."""

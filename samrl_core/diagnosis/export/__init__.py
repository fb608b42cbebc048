"""The correction in users' simulators: changed models, what they cannot express, what comes nearest."""

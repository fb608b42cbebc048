"""Cell instances: in what one real cell differs from the nominal one that the model knows.

A group is a file with one dataclass; each of its fields says what differs, how far at each level, and who
says so. An instance is drawn once from its name and stays for many episodes. Only worlds and evaluation hold
one (`tests/architecture/test_truth.py`).
"""

"""What touching tells: forces at the tip from joint torques, a search for the hole, and what an episode
leaves for the next one in the same cell.
"""

"""Peg insertion: a round peg into a hole drawn within 10 cm x 10 cm."""

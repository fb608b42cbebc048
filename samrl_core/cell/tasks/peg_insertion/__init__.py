"""Peg insertion: a round peg into a hole sampled within 10 cm x 10 cm."""

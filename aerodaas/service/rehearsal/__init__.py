"""Rehearsal of a mission in simulation: its verdict and its picture."""

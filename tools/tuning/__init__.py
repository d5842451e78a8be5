"""Flies a follower after a walking person in simulation, to measure and to tune it."""

"""Autopilots in simulation (software in the loop) that the user has installed."""

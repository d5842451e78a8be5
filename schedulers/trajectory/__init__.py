"""Trajectory schedulers: the order in which waypoints are visited."""

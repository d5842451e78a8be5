"""Autopilots in simulation that the user has installed: found, started, and ended again."""

"""Elevation files, of which the ground around home is read."""

"""Waypoints that the autopilot flies by its own mission mode for a while."""

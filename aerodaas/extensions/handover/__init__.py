"""Waypoints handed over to the autopilot's own mission mode."""

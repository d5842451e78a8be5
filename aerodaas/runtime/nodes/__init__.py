"""Nodes of a flight: drone, camera, analysis and recorder."""

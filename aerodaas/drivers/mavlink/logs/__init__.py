"""Logs on an autopilot's card: listed and downloaded."""

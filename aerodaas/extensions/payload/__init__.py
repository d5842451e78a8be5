"""Gimbal, pictures and video of a mission."""

"""Cameras: one protocol for simulated, recorded and live images."""

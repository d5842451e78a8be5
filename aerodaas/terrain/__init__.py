"""Terrain: heights of the ground from elevation files, and the ground beneath a flight."""

"""Watching a mission in the terminal."""

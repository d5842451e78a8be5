"""Replay of a recording: cameras, vehicles, and the timestamps of each source."""

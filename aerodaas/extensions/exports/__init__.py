"""Recordings for other programs: videos, tracks and datasets."""

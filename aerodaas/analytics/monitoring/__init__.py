"""Watching readings, distances and GPS loggers."""

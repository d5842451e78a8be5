"""Monitoring of readings, distances and GPS loggers."""

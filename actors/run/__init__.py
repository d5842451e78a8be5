"""Runs of an application: planning of its actors, their start, growth and shutdown."""

"""Sections of an environment file."""

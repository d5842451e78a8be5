"""Analyses that ship with the project, and the base for one's own."""

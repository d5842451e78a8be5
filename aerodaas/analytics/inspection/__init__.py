"""Inspection of structures."""

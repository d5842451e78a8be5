"""Kits that the author of a plug-in runs against their own class."""

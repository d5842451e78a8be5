"""Features that the core flies without: a folder each, which may be deleted.

A folder holds everything of its feature and an `extension.py`, whose `EXTENSION` tells the core
what it adds.
"""

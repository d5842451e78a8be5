"""A recording as a page plays it: what happened when, and any moment's pictures."""

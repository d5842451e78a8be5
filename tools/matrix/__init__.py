"""Tests the wheel on each Python that is found: `python -m tools.matrix`."""

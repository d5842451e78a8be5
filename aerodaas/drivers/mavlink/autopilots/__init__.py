"""The autopilot families, each behind the same seam."""

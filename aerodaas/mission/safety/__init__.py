"""Flight safety: limits, geofence, failsafes, and consistency checks of a drone's state."""

"""Players of a recording: cameras, vehicles, and the timeline of a flight."""

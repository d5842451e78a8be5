"""Recording of flights to MCAP, reading of recordings, replay, export and reports."""

"""Recording to MCAP, reading, plots."""

"""Text of strangers: JSON and XML read within limits, and what a terminal may print."""

"""Recording a flight to MCAP, reading it again, and reporting on it."""

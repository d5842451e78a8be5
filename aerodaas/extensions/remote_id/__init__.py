"""Remote ID of a MAVLink vehicle: who operates it, and whether its transmitter is ready."""

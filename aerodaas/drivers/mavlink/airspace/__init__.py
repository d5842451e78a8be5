"""Remote ID, and traffic that a MAVLink vehicle hears of."""

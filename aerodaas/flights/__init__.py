"""The process of one flight that a service starts."""

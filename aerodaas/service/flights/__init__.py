"""Flights: one process each, which outlives the service and is found again by its folder."""

"""Flights on real autopilots in simulation."""

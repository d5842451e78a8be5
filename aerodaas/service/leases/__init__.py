"""Leases of drones."""

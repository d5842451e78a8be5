"""Drivers: one Vehicle protocol for simulated and real drones."""

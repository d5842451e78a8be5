"""Lockstep execution: the barrier and the gate that hold mission time."""

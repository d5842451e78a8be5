"""Lockstep: the barrier and the gate at which mission time waits."""

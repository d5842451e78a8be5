"""Trajectory schedulers: who is visited next."""

"""Schedulers: pure classes that see events and an explicit now, and return decisions."""

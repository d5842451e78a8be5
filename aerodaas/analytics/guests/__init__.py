"""Guests: analyses that run in an untrusted process of their own, and the wire to it."""

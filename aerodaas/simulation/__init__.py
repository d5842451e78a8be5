"""Embedded simulator: world, flight dynamics and renderer."""

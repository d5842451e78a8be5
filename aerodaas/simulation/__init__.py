"""The embedded simulator: world, flight dynamics, renderer."""

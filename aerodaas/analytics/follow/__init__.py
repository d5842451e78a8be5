"""Analyses that follow a target; the geometry and the controllers are in `aerodaas.following`."""

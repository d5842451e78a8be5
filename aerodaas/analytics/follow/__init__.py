"""Analyses that follow a target; geometry and controllers are in `aerodaas.following`."""

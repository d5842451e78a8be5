"""Analyses at the user's side: their stand-ins in a provider's flight, and the relay between."""

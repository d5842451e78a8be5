"""The user's end of a provider's service: its catalogue, submission of missions, their streams."""

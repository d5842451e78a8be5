"""Lists the licences of all that an installation brings: `python -m tools.licences`."""

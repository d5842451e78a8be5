"""Ray clusters: starting a local one, joining a remote one, shutdown and monitoring."""

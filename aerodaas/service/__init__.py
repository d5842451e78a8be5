"""The provider's service: a fleet of drones that applications of others fly on, by URL."""

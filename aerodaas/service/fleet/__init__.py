"""The provider's fleet: its drones, and its view for the page."""

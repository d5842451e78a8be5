"""What the provider's service and its clients say to each other."""

"""The API of one's own flight, and of recordings."""

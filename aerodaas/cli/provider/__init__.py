"""Commands of a provider's fleet: serving it, and flying on it."""

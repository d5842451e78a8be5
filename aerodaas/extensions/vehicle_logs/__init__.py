"""A vehicle's own logs: fetched from it, laid over a recording, and shown in its report."""

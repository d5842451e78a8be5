"""Ray itself: a local one, a cluster to join, their ends, and the watch over their actors."""

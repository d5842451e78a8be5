"""Ray itself: a local one, a cluster to join, what ends them, and what watches over them."""

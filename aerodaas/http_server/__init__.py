"""What every HTTP server has: names it answers to, bounds, refusals, wrong tokens."""

"""Analytics schedulers: which inference runs where, and when."""

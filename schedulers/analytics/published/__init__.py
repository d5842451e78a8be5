"""The published analytics schedulers, and the orders and estimates that they share."""

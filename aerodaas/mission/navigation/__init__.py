"""The way of one drone: queue, plans, legs, routes and corners."""

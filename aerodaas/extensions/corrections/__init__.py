"""Corrections of a base station, which a vehicle's receiver needs for RTK."""

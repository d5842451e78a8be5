"""Frames of reference, geodesy, depth, braking, free paths and energy."""

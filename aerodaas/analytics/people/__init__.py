"""Analyses of people in images: joints, gestures, falls and crowd density."""

"""Plots of a flight, one module each; no plot relies on colour alone."""

"""The laboratory: a discrete-event simulator that drives the analytics schedulers."""

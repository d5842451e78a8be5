"""Feeds broken input to the code that reads what strangers send: `python -m tools.fuzz`.

A target is a module of `tools.fuzz.targets` with `seeds()`, `run(data)` and, if bytes alone are too
blunt, `mutate(data, rng)`.
"""

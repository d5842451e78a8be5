"""Lockstep: the same actors, whose mission time waits until all of them have processed its data.

Each actor that behaves differently has a subclass here; the rest of the project does not
distinguish. The drone's actor conducts time by the barrier, and the gate holds time for changes
to the graph.
"""

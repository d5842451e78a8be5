"""The mission layer: queue, state machine, safety."""

"""Mission control of one drone: queue, navigator, state machine, and the setpoint loop.

It may import `types`, `config`, `dataflow` and `schedulers`; it reads no clock.
"""

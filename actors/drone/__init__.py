"""Drone actor (vehicle, mission, setpoint loop) and the trajectory scheduler's actor."""

"""Actuators of a mission: grippers, relays, servos and parachutes."""

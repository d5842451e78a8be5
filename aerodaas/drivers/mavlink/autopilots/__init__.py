"""The autopilot families behind one interface."""

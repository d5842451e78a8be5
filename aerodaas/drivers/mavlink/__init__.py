"""PX4 and ArduCopter over MAVLink 2: UDP, TCP or serial."""

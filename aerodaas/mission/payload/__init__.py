"""Pictures, video, gimbals and actuators in a mission."""

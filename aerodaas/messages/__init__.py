"""What flows between nodes or is stored: frames, detections, odometry, waypoints, mission status.

Each message is one frozen dataclass with its units.
"""

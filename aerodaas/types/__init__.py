"""Plain values that everything else is about: frames, odometry, waypoints, status, clock.

It imports nothing else of the project.
"""

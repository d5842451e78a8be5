"""ROS 2: drones and cameras by topics, flights on topics, and bags."""

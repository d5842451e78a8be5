"""ROS 2 bags: recordings written as bags, and bags read as recordings."""

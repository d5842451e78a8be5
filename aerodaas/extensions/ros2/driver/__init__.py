"""Driver of any drone that publishes odometry and takes velocities on ROS 2 topics."""

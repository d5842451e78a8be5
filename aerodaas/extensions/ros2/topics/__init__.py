"""Live ROS 2 topics over DDS, without ROS: messages, names, quality of service and time stamps."""

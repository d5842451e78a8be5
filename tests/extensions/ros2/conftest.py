"""A ROS 2 domain on loopback for every test of ROS 2."""

from ros_domain import loopback_domain, ros_link, topics

__all__ = ["loopback_domain", "ros_link", "topics"]

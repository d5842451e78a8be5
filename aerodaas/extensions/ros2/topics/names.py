"""Names of ROS 2 topics, and of what they are called in DDS."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator, Field

__all__ = ["Domain", "TopicName", "dds_topic", "permitted_topic", "ros_topic", "ros_type"]

_PATTERN = r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$"
_FORBIDDEN = re.compile(r"[^A-Za-z0-9_/]")
_LEADING_DIGIT = re.compile(r"/(?=[0-9])")
_PREFIX = "rt/"
"""Before the names of ROS 2's topics, as against those of services and actions."""

Domain = Annotated[int, Field(ge=0, le=232)]
"""A DDS domain, as ROS_DOMAIN_ID names it: 232 is the last whose ports UDP has."""


def _absolute(name: str) -> str:
    return name if name.startswith("/") else f"/{name}"


TopicName = Annotated[str, Field(pattern=_PATTERN, max_length=200), AfterValidator(_absolute)]
"""Name of a topic, absolute: one without a leading slash is given it."""


def dds_topic(name: str) -> str:
    """DDS' name of a topic.

    >>> dds_topic("/drone/odom")
    'rt/drone/odom'
    """
    return _PREFIX + name.removeprefix("/")


def permitted_topic(name: str) -> str:
    """A name as like `name` as ROS 2's rules permit.

    Letters, digits and `_`; no part begins with a digit.

    >>> permitted_topic("/drone-1/2nd/image")
    '/drone_1/_2nd/image'
    """
    return _LEADING_DIGIT.sub("/_", _FORBIDDEN.sub("_", name))


def ros_topic(name: str) -> str:
    """ROS 2's name of a topic of DDS; empty if it is none of ROS 2's.

    >>> ros_topic("rt/drone/odom")
    '/drone/odom'
    """
    return f"/{name.removeprefix(_PREFIX)}" if name.startswith(_PREFIX) else ""


def ros_type(name: str) -> str:
    """ROS 2's name of a type of DDS.

    >>> ros_type("sensor_msgs::msg::dds_::Image_")
    'sensor_msgs/msg/Image'
    """
    return name.removesuffix("_").replace("::dds_::", "::").replace("::", "/")

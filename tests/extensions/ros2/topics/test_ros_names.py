"""Names of ROS 2 and of DDS."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter, ValidationError

from aerodaas.extensions.ros2.topics.names import TopicName, dds_topic, ros_topic, ros_type

TOPIC: TypeAdapter[str] = TypeAdapter(TopicName)


def test_topics_and_types_are_told_by_both_names() -> None:
    """As the middleware of ROS 2 mangles them."""
    assert dds_topic("/drone/image_raw") == "rt/drone/image_raw"
    assert ros_topic("rt/drone/image_raw") == "/drone/image_raw"
    assert ros_topic("rq/drone/set_mode") == "", "a service"
    assert ros_type("sensor_msgs::msg::dds_::Image_") == "sensor_msgs/msg/Image"


@pytest.mark.parametrize("name", ["/a", "a/b_2/C", "/_x"])
def test_names_of_topics_are_absolute(name: str) -> None:
    """With or without the slash."""
    assert TOPIC.validate_python(name) == "/" + name.removeprefix("/")


@pytest.mark.parametrize("name", ["", "/", "/a/", "//a", "/1a", "/a b", "/a-b", "~/a", "/a\n"])
def test_what_is_no_name_is_refused(name: str) -> None:
    """By ROS 2's rules."""
    with pytest.raises(ValidationError):
        TOPIC.validate_python(name)

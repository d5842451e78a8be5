"""Topics of a ROS 2 domain, on loopback."""

from __future__ import annotations

import importlib.util
from typing import Any

import numpy as np
import pytest
from ros_domain import DOMAIN
from waiting import until

from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink, domain_of, require_dds


def test_messages_reach_subscribers(ros_link: RosLink, topics: str) -> None:
    """Of another participant, the newest one at the latest; and both ends find each other."""
    heard: list[Any] = []
    other = RosLink(DOMAIN)
    try:
        other.subscribe(f"{topics}/enable", types.BOOL, heard.append)
        publisher = ros_link.publisher(f"{topics}/enable", types.BOOL)
        until(lambda: publisher.listeners == 1)
        publisher.publish(types.ros_message(types.BOOL, data=True))
        until(lambda: heard)
        assert heard[-1] == types.ros_message(types.BOOL, data=True)
        until(lambda: other.published().get(f"{topics}/enable") == "std_msgs/msg/Bool")
    finally:
        other.close()
    until(lambda: publisher.listeners == 0)


@pytest.mark.usefixtures("loopback_domain")
def test_a_closed_link_is_silent(topics: str) -> None:
    """Closing twice is no error; what it published by publishes nothing."""
    made = RosLink(DOMAIN)
    publisher = made.publisher(f"{topics}/enable", types.BOOL)
    assert publisher.publish(types.ros_message(types.BOOL, data=True))
    made.close()
    made.close()
    assert not publisher.publish(types.ros_message(types.BOOL, data=True))
    assert publisher.listeners == 0


def test_a_message_that_cannot_be_decoded_is_counted(
    ros_link: RosLink, topics: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the next one is heard."""
    heard: list[Any] = []
    ros_link.subscribe(f"{topics}/image", types.COMPRESSED_IMAGE, heard.append)
    publisher = ros_link.publisher(f"{topics}/image", types.COMPRESSED_IMAGE)
    until(lambda: publisher.listeners == 1)
    store = types.ros_types()
    decode = store.deserialize_cdr

    def spoiled(data: bytes, name: str) -> object:
        if b"spoiled" in data:
            raise UnicodeDecodeError("utf-8", data, 0, 1, "not the text that was promised")
        return decode(data, name)

    monkeypatch.setattr(store, "deserialize_cdr", spoiled)
    publisher.publish(types.ros_message(types.COMPRESSED_IMAGE, format="spoiled"))
    until(lambda: ros_link.garbled == 1)
    whole = np.arange(5, dtype=np.uint8)
    publisher.publish(types.ros_message(types.COMPRESSED_IMAGE, data=whole))
    until(lambda: heard)
    assert [one.data.tolist() for one in heard] == [[0, 1, 2, 3, 4]]


def test_the_domain_is_that_of_the_setting_or_of_ros(monkeypatch: pytest.MonkeyPatch) -> None:
    """As for every other node of the machine."""
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert domain_of(None) == 42
    assert domain_of(7) == 7
    monkeypatch.setenv("ROS_DOMAIN_ID", "")
    assert domain_of(None) == 0
    for wrong in ("233", "-1", "seven"):
        monkeypatch.setenv("ROS_DOMAIN_ID", wrong)
        with pytest.raises(ConfigError, match=rf"0 to 232, not '{wrong}'"):
            domain_of(None)


def test_without_cyclone_the_remedy_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """An extra."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ConfigError, match=r"robot x: the driver ros2 needs .*aerodaas\[ros\]"):
        require_dds("robot x: the driver ros2")


def test_a_network_that_cannot_be_joined_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the variable that may be to blame."""
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><Nonsense>")
    with pytest.raises(SourceError, match=r"cannot join the ROS 2 domain 9 .*CYCLONEDDS_URI"):
        RosLink(9)

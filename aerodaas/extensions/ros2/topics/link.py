"""A participant of a ROS 2 domain by DDS: subscriptions, publishers, and what topics there are."""

from __future__ import annotations

import importlib.util
import logging
import os
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from aerodaas.errors import ConfigError, SourceError
from aerodaas.extensions.ros2.topics.names import dds_topic, ros_topic, ros_type
from aerodaas.extensions.ros2.topics.types import dds_type

if TYPE_CHECKING:
    from cyclonedds.pub import DataWriter

__all__ = ["RosLink", "RosPublisher", "domain_of", "require_dds"]

_log = logging.getLogger(__name__)
_LAST_DOMAIN = 232
_BLOCKING = 100_000_000
"""Nanoseconds that a reliable writer may wait for a reader, ROS 2's own default."""
_TURN = 100_000_000
"""Longest wait in nanoseconds, after which the link's thread looks whether it is to end."""
_MOST_ENDPOINTS = 1000
"""Publishers of a domain that are looked at."""


def require_dds(purpose: str) -> None:
    """Raise ConfigError, with the remedy, unless Cyclone DDS is installed.

    `purpose` is the subject of the error's sentence, in the singular.
    """
    if importlib.util.find_spec("cyclonedds") is None:
        raise ConfigError(
            f"{purpose} needs cyclonedds: pip install 'aerodaas[ros]'; on Linux on ARM64, for "
            "which it has no wheel, build it as docs/ros2.md says"
        )


def domain_of(setting: int | None) -> int:
    """The DDS domain: the setting's, else that of ROS_DOMAIN_ID, else 0; raises ConfigError."""
    if setting is not None:
        return setting
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isascii() or not text.isdigit() or int(text) > _LAST_DOMAIN:
        raise ConfigError(f"ROS_DOMAIN_ID must be a number from 0 to {_LAST_DOMAIN}, not {text!r}")
    return int(text)


class RosPublisher:
    """Publishes messages of one type on one topic; any thread may use it."""

    def __init__(self, writer: DataWriter[Any], encoded: Callable[[Any], Any]) -> None:
        """Publish by `writer` what `encoded` makes of messages."""
        self._writer: DataWriter[Any] | None = writer
        self._encoded = encoded

    @property
    def listeners(self) -> int:
        """Subscriptions that it has found."""
        writer = self._writer
        return 0 if writer is None else len(writer.get_matched_subscriptions())

    def publish(self, message: Any) -> bool:  # noqa: ANN401 - a message of the topic's type
        """Publish; returns whether it was taken: a reliable subscriber may be too far behind."""
        from cyclonedds.core import DDSException  # noqa: PLC0415 - an extra

        writer = self._writer
        if writer is None:
            return False
        try:
            writer.write(self._encoded(message))
        except DDSException as error:
            _log.debug("not published: %s", error)
            return False
        return True

    def close(self) -> None:
        """Publish nothing more."""
        self._writer = None


class RosLink:
    """One participant. Its own thread hands out what subscriptions take, newest message only."""

    def __init__(self, domain: int) -> None:
        """Join `domain`.

        Raises:
            ConfigError: If Cyclone DDS is not installed.
            SourceError: If no network interface can be used, or CYCLONEDDS_URI is wrong.
        """
        require_dds("a ROS 2 topic")
        from cyclonedds.core import DDSException, GuardCondition, WaitSet  # noqa: PLC0415
        from cyclonedds.domain import DomainParticipant  # noqa: PLC0415

        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise SourceError(
                f"cannot join the ROS 2 domain {domain} ({error.msg}); check the network and what "
                "CYCLONEDDS_URI says (docs/ros2.md)"
            ) from error
        self.domain = domain
        self.garbled = 0
        """Messages that could not be decoded."""
        self._waiting = WaitSet(self._participant)
        self._bell = GuardCondition(self._participant)
        self._waiting.attach(self._bell)
        self._takers: list[Callable[[], None]] = []
        self._publishers: list[RosPublisher] = []
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="ros2", daemon=True)
        self._thread.start()

    def subscribe(self, topic: str, kind: str, take: Callable[[Any], None]) -> None:
        """Call `take` with the newest message of `topic`, in the link's thread, as they come.

        Best effort, which any publisher's quality of service satisfies.

        Args:
            topic: Name of the topic.
            kind: Name of its type, such as `nav_msgs/msg/Odometry`.
            take: Is called with messages of that type.
        """
        from cyclonedds.core import (  # noqa: PLC0415
            InstanceState,
            ReadCondition,
            SampleState,
            ViewState,
        )
        from cyclonedds.qos import Policy, Qos  # noqa: PLC0415
        from cyclonedds.sub import DataReader  # noqa: PLC0415
        from cyclonedds.topic import Topic  # noqa: PLC0415

        qos = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1))
        described: Any = Topic(self._participant, dds_topic(topic), dds_type(kind))
        reader = DataReader(self._participant, described, qos=qos)
        fresh = ReadCondition(reader, ViewState.Any | InstanceState.Alive | SampleState.NotRead)

        def taker() -> None:
            try:
                found = reader.take(condition=fresh)
            except Exception:  # noqa: BLE001 - a stranger's bytes, decoded by the binding
                self.garbled += 1
                return
            for one in found:
                take(one)

        with self._lock:
            self._takers.append(taker)
        self._waiting.attach(fresh)
        self._bell.set(True)

    def publisher(self, topic: str, kind: str, *, latched: bool = False) -> RosPublisher:
        """A reliable publisher of a topic, which every subscriber can hear.

        Args:
            topic: Name of the topic.
            kind: Name of its type, such as `nav_msgs/msg/Odometry`.
            latched: Keep the newest message for those who subscribe later (ROS 2's transient
                local).
        """
        from cyclonedds.pub import DataWriter  # noqa: PLC0415
        from cyclonedds.qos import Policy, Qos  # noqa: PLC0415
        from cyclonedds.topic import Topic  # noqa: PLC0415

        durability = Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile
        qos = Qos(
            Policy.Reliability.Reliable(_BLOCKING),
            Policy.History.KeepLast(1),
            durability,
        )
        encoded = dds_type(kind)
        described: Any = Topic(self._participant, dds_topic(topic), encoded)
        made = RosPublisher(DataWriter(self._participant, described, qos=qos), encoded)
        self._publishers.append(made)
        return made

    def published(self) -> dict[str, str]:
        """Topics that somebody publishes, and their types, by ROS 2's names."""
        from cyclonedds.builtin import (  # noqa: PLC0415
            BuiltinDataReader,
            BuiltinTopicDcpsPublication,
        )

        reader = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        found = {
            ros_topic(one.topic_name): ros_type(one.type_name)
            for one in reader.read(_MOST_ENDPOINTS)
            if one.sample_info.valid_data
        }
        found.pop("", None)
        return dict(sorted(found.items()))

    def close(self) -> None:
        """Leave the domain; a second call does nothing."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._bell.set(True)
        self._thread.join(timeout=5.0)
        for publisher in self._publishers:
            publisher.close()
        # The binding deletes what nobody refers to.
        self._takers.clear()
        del self._waiting, self._bell, self._participant

    def _listen(self) -> None:
        while not self._closing.is_set():
            self._waiting.wait(_TURN)
            self._bell.take()
            with self._lock:
                takers = tuple(self._takers)
            for taker in takers:
                taker()

"""A ROS 2 domain on loopback alone, of each test's own topics."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator

import pytest

from aerodaas.extensions.ros2.topics.link import RosLink

__all__ = ["DOMAIN", "LOOPBACK", "loopback_domain", "ros_link", "topics"]

LOOPBACK = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="lo"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Cyclone's configuration: unicast on loopback, for machines without multicast, too."""
DOMAIN = 10 + os.getpid() % 200
"""Tests that run beside these have another."""

_numbers = itertools.count()


@pytest.fixture
def loopback_domain(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever joins a domain now joins this one, and talks on loopback alone."""
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(DOMAIN))


@pytest.fixture
def topics() -> str:
    """Before the names of the test's topics, which no other test's bear."""
    return f"/test{os.getpid()}_{next(_numbers)}"


@pytest.fixture
def ros_link(loopback_domain: None) -> Iterator[RosLink]:
    """The other end."""
    del loopback_domain
    made = RosLink(DOMAIN)
    yield made
    made.close()

"""A ROS 2 domain on loopback alone, of each test's own topics."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable, Iterator

import pytest

from aerodaas.extensions.ros2.topics.link import RosLink

__all__ = ["DOMAIN", "LOOPBACK", "loopback_domain", "ros_link", "topics", "wait_for"]

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


def wait_for(condition: Callable[[], object], timeout: float = 20.0) -> None:
    """Return when `condition` holds; fail the test if it never does."""
    deadline = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


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

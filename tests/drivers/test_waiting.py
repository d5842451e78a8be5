"""Waiting for descriptors, of which a process may have thousands."""

from __future__ import annotations

import fcntl
import resource
import socket
from collections.abc import Iterator

import pytest

from aerodaas.drivers.waiting import wait_readable

FAR = 1500
"""A descriptor beyond those that `select` takes."""


@pytest.fixture
def far_pair() -> Iterator[tuple[socket.socket, int]]:
    """A socket, and the far descriptor of the other end."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard <= 2 * FAR:
        pytest.skip(f"this system lets a process open {hard} files: raise `ulimit -n`")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 2 * FAR), hard))
    one, other = socket.socketpair()
    number = fcntl.fcntl(other, fcntl.F_DUPFD, FAR)
    try:
        yield one, number
    finally:
        socket.close(number)
        one.close()
        other.close()
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


def test_a_descriptor_of_any_number_is_waited_for(far_pair: tuple[socket.socket, int]) -> None:
    """What has arrived ends the wait at once, long before its time."""
    one, number = far_pair
    assert number >= FAR
    one.send(b"!")
    wait_readable([number, -1], 250.0)
    assert socket.socket(fileno=fcntl.fcntl(number, fcntl.F_DUPFD, 0)).recv(1) == b"!"


def test_nothing_to_wait_for_ends_with_the_time() -> None:
    """A port that was closed is none."""
    wait_readable([-1], 0.01)
    wait_readable([], 0.0)

"""When the process that flies a Tello dies or hangs, the Tello stops and the wire is silent."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest
from tello_flights import LOOPBACK

from aerodaas.extensions.tello.dead_man import DeadMan

pytestmark = pytest.mark.wall_clock

_FLYING = """
import socket, sys, time
from aerodaas.extensions.tello.dead_man import DeadMan
link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.bind(("127.0.0.1", 0))
guard = DeadMan(link, ("127.0.0.1", int(sys.argv[1])))
while True:
    link.sendto(b"rc 0 60 0 0", ("127.0.0.1", int(sys.argv[1])))
    guard.restart(moving=True)
    time.sleep(0.05)
"""


@pytest.fixture
def ear() -> Iterator[socket.socket]:
    """Where the Tello would listen."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.bind((LOOPBACK, 0))
        opened.settimeout(20.0)
        yield opened


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGSTOP])
def test_a_dead_or_hanging_driver_is_stopped_from_its_own_port(
    ear: socket.socket, blow: signal.Signals
) -> None:
    """`rc 0 0 0 0` comes from the socket that the Tello knows, then nothing."""
    command = [sys.executable, "-c", _FLYING, str(ear.getsockname()[1])]
    driver = subprocess.Popen(command)
    try:
        said, known = ear.recvfrom(100)
        time.sleep(0.5)
        assert said == b"rc 0 60 0 0"
        os.kill(driver.pid, blow)
        said, sender = ear.recvfrom(100)
        while said == b"rc 0 60 0 0":
            said, sender = ear.recvfrom(100)
        assert said == b"rc 0 0 0 0"
        assert sender == known
        time.sleep(0.5)
        ear.settimeout(1.0)
        assert [ear.recv(100) for _ in range(2)] == [b"rc 0 0 0 0"] * 2
        with pytest.raises(TimeoutError):
            ear.recv(100)
    finally:
        driver.kill()
        driver.wait()


@pytest.mark.parametrize("moving", [True, False])
def test_a_goodbye_is_silent(ear: socket.socket, *, moving: bool) -> None:
    """Whoever closes in order has said his own last word."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        guard = DeadMan(link, ear.getsockname())
        guard.restart(moving=moving)
        guard.close()
    ear.settimeout(0.5)
    with pytest.raises(TimeoutError):
        ear.recv(100)

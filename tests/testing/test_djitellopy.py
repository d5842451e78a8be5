"""An independent client flies the emulated Tello: what we test against is not only our own idea.

djitellopy brings another OpenCV, so that it needs an environment of its own, named by its Python::

    python -m venv /tmp/djitellopy && /tmp/djitellopy/bin/pip install djitellopy
    AERODAAS_DJITELLOPY=/tmp/djitellopy/bin/python python -m pytest tests/testing
"""

from __future__ import annotations

import json
import socket
import subprocess
from pathlib import Path

import pytest
from required import needs_peer, peer

from aerodaas.messages.vehicle import VehicleMode
from tools.tello_vehicle import EmulatedTello, TelloOptions, VideoOptions

PYTHON = peer("AERODAAS_DJITELLOPY")

pytestmark = [
    pytest.mark.slow,
    needs_peer("AERODAAS_DJITELLOPY"),
    pytest.mark.wall_clock,
]


def _free_ports(count: int) -> list[int]:
    probes = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for probe in probes:
        probe.bind(("127.0.0.1", 0))
    ports = [probe.getsockname()[1] for probe in probes]
    for probe in probes:
        probe.close()
    return ports


def test_djitellopy_flies_the_emulated_tello() -> None:
    """Take-off, moves, a turn, `go`, a refusal, `rc`, video and landing, by its own code."""
    video = VideoOptions(world="campus", width=480, height=360, rate=15.0, key_interval=15)
    with EmulatedTello(TelloOptions(video=video)) as tello:
        client = str(Path(__file__).with_name("djitellopy_client.py"))
        command = [PYTHON, client, str(tello.port), *map(str, _free_ports(3))]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
        seen = json.loads(done.stdout.splitlines()[-1])
        mode, position = tello.mode, tello.truth.position
    assert seen["battery"] in {89, 90}
    assert seen["sdk"] == "30"
    assert seen["height"] == pytest.approx(80, abs=10)
    assert abs(seen["yaw"] + 90) <= 5, "counter-clockwise is negative"
    assert "out of range" in seen["refusal"]
    assert abs(seen["speed"][0]) <= 1, "it looks north now, and x is where it looked at first"
    assert seen["speed"][1] == pytest.approx(-5, abs=1), "decimetres per second, y to the right"
    assert seen["frame"][:3] == [360, 480, 3]
    assert seen["frame"][3] > 20.0, "a picture, not a grey field"
    assert seen["landed"] == 0
    assert mode is VehicleMode.GROUNDED
    assert position[0] == pytest.approx(0.6, abs=0.3)
    assert position[1] > 0.8

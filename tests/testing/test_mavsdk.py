"""An independent client flies the emulated PX4: what we test against is not only our own idea.

MAVSDK lives in an environment of its own, named by its Python::

    python -m venv /tmp/mavsdk && /tmp/mavsdk/bin/pip install mavsdk
    AERODAAS_MAVSDK=/tmp/mavsdk/bin/python python -m pytest tests/testing/test_mavsdk.py
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
from pathlib import Path

import pytest

from aerodaas.testing.mavlink import AutopilotOptions, EmulatedAutopilot

PYTHON = os.environ.get("AERODAAS_MAVSDK", "")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not PYTHON, reason="AERODAAS_MAVSDK names no Python with MAVSDK"),
    pytest.mark.wall_clock,
]


def test_mavsdk_flies_the_emulated_px4() -> None:
    """Parameters, arming, take-off, offboard velocity and landing, by its own code."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    options = AutopilotOptions(family="px4", peer=("127.0.0.1", port))
    with EmulatedAutopilot(options) as autopilot:
        client = str(Path(__file__).with_name("mavsdk_client.py"))
        command = [PYTHON, client, str(port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=150, check=False)
        assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
        seen = json.loads(done.stdout.splitlines()[-1])
        motions = autopilot.firmware.motions
    assert seen["autopilot"] == "PX4"
    assert seen["parameter"] == 0
    assert 2.0 <= seen["height"] < 4.0
    assert seen["armed"]
    assert seen["north"] == pytest.approx(1.0, abs=0.3)
    assert not seen["armed at last"]
    assert motions == ["arm", "take off", "follow", "land"]

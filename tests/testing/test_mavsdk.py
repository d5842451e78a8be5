"""An independent client flies the emulated autopilots: not only our own idea of them.

MAVSDK lives in an environment of its own, named by its Python::

    python -m venv /tmp/mavsdk && /tmp/mavsdk/bin/pip install mavsdk
    AERODAAS_MAVSDK=/tmp/mavsdk/bin/python python -m pytest tests/testing/test_mavsdk.py
"""

from __future__ import annotations

import json
import socket
import subprocess
from pathlib import Path
from typing import Literal

import pytest
from autopilot_facts import VERSIONS
from required import needs_peer, peer

from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

PYTHON = peer("AERODAAS_MAVSDK")

pytestmark = [
    pytest.mark.slow,
    needs_peer("AERODAAS_MAVSDK"),
    pytest.mark.wall_clock,
]


@pytest.mark.parametrize("family", ["px4", "ardupilot"])
def test_mavsdk_flies_it(family: Literal["px4", "ardupilot"]) -> None:
    """Version, parameters, health, arming, take-off, go-to, offboard and landing, by its code."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = int(probe.getsockname()[1])
    options = AutopilotOptions(family=family, peer=("127.0.0.1", port))
    with EmulatedAutopilot(options) as autopilot:
        client = str(Path(__file__).with_name("mavsdk_client.py"))
        command = [PYTHON, client, str(port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=150, check=False)
        assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
        seen = json.loads(done.stdout.splitlines()[-1])
        firmware = autopilot.firmware
    assert seen["version"] == list(VERSIONS[family])
    assert seen["parameters"] == len(firmware.parameters.values)
    assert seen["satellites"] >= 6
    assert seen["battery"] == pytest.approx(90.0, abs=2.0)
    # MAVSDK does not ask ArduPilot for SYS_STATUS, and does not know without it.
    assert seen["global position"] is (family == "px4")
    assert 2.0 <= seen["height"] < 4.0
    assert seen["armed"]
    assert seen["metres from there"] < 0.6
    assert not seen["armed at last"]
    assert firmware.motions[:2] == ["arm", "take off"]
    assert "go to" in firmware.motions
    assert firmware.motions[-1] == "land"
    if family == "px4":
        assert seen["parameter"] == 0
        assert seen["all well"]
        assert seen["north"] == pytest.approx(1.0, abs=0.3)

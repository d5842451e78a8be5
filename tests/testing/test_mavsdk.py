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
from typing import Any, Literal

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


def _free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _seen_by(client: str, port: int) -> dict[str, Any]:
    """What the `client` tells of the vehicle that speaks to `port`."""
    command = [PYTHON, str(Path(__file__).with_name(client)), str(port)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=150, check=False)
    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-2000:]
    seen: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return seen


@pytest.mark.parametrize("family", ["px4", "ardupilot"])
def test_mavsdk_flies_it(family: Literal["px4", "ardupilot"]) -> None:
    """Version, parameters, health, arming, take-off, go-to, offboard and landing, by its code."""
    port = _free_port()
    options = AutopilotOptions(family=family, peer=("127.0.0.1", port))
    with EmulatedAutopilot(options) as autopilot:
        seen = _seen_by("mavsdk_client.py", port)
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


def test_mavsdk_uses_its_camera_and_its_gimbal() -> None:
    """Found by their own ids, asked what they are, turned, zoomed, focused, a picture taken."""
    port = _free_port()
    options = AutopilotOptions(peer=("127.0.0.1", port), components=(100, 154))
    with EmulatedAutopilot(options) as autopilot:
        camera = autopilot.components[100].payload
        camera.free, camera.video = 5000.0, "rtsp://127.0.0.1/main"
        seen = _seen_by("mavsdk_payload_client.py", port)
        lens = dict(camera.lens)
    assert seen["gimbal"] == [154, "emulated"]
    assert seen["looks"] == pytest.approx([0.0, -40.0, 20.0], abs=0.5)
    assert seen["in control"]
    assert seen["camera"] == [100, "emulated", 5472]
    assert seen["focal length"] == pytest.approx(8.8)
    assert seen["pictures"] == [[True, 0, "DCIM/0001.JPG"]]
    assert seen["pitch of it"] == pytest.approx(0.0, abs=1e-3)
    assert lens == {"zoom": 40.0, "focus": 60.0}
    assert seen["free"] == [5000.0]
    assert seen["video"] == ["rtsp://127.0.0.1/main"]

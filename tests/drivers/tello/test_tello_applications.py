"""Situation Awareness as it is, its driver changed alone, on a Tello that films people."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tello_evidence import Witness
from tello_flights import free_port

from aerodaas.config import EnvironmentConfig
from aerodaas.testing.tello import EmulatedTello, TelloOptions, VideoOptions

from missions.criteria import (  # isort: skip - found by tello_evidence
    distance_held,
    fence_kept,
    followed,
    hit_nothing,
    landed,
    landed_upon,
    states,
)

ROOT = Path(__file__).parents[3]
FLIGHT = 420.0
"""Seconds that an application may take, its start and end included; the hand is raised at 245."""

CRITERIA = (
    states("taking_off holding? (following holding?)+ landing landed"),
    followed("vip", 40, reach=4.0),
    distance_held("vip", 2.0, within=0.5, share=0.8, nearest=0.8),
    landed_upon("vip", "hand_raised", within=6.0),
    landed(),
    hit_nothing,
    fence_kept,
)
"""As for the simulated drone, but that the person may be nearer for a moment, and that no fall is
told: who lies two metres ahead is cut by the lower edge of a Tello's narrow picture."""

pytestmark = [pytest.mark.slow, pytest.mark.timeout(FLIGHT + 60)]


def fly(application: str, tello: EmulatedTello, folder: Path) -> Path:
    """`aerodaas run`, as a user types it, but for ports that nobody else uses; the recording."""
    words = [
        *(sys.executable, "-m", "aerodaas", "run", str(ROOT / "apps" / f"{application}.py")),
        *("--no-view", "--record", str(folder / "flight")),
        *("--set", "tello.driver=tello", "--set", "tello.address=127.0.0.1"),
        *("--set", f"tello.command_port={tello.port}"),
        *("--set", f"tello.state_port={free_port()}", "--set", f"cam1.video_port={free_port()}"),
    ]
    paths = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    variables = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(
        words,
        cwd=folder,
        env=variables,
        capture_output=True,
        text=True,
        timeout=FLIGHT,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "flight" / "flight.mcap"


def test_situation_awareness(tmp_path: Path) -> None:
    """The shipped models find the person in H.264, the Tello follows, and lands at the hand."""
    video = VideoOptions(width=640, height=480, rate=10.0)
    environment = EnvironmentConfig.load(ROOT / "apps/environments/campus.json")
    options = TelloOptions(video=video).placed(environment)
    with EmulatedTello(options) as tello, Witness(tello) as witness:
        recording = fly("situation_awareness", tello, tmp_path)
    evidence = witness.evidence(recording)
    checks = [criterion(evidence) for criterion in CRITERIA]
    told = "\n".join(f"{check.what}: {check.found}" for check in checks)
    assert all(check.holds for check in checks), told

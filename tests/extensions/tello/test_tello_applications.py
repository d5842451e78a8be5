"""Applications as they are, their driver changed alone, on a Tello that films people."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from required import needs_peer
from tello_evidence import TelloWitness
from tello_flights import free_port

from aerodaas.config.model import EnvironmentConfig
from tools.tello_vehicle import EmulatedTello, TelloOptions, VideoOptions

from missions.catalogue import MISSIONS  # isort: skip - found by tello_evidence

ROOT = Path(__file__).parents[3]
WORLDS = {"situation_awareness": "campus", "search_and_rescue": "rescue"}
APPLICATIONS = [name for name in os.environ.get("AERODAAS_TEST_TELLO", "").split(",") if name]
"""Those flown: each takes five minutes of a machine with nothing beside it, longer than all other
flights on a Tello together."""
FLIGHT = 560.0
"""Seconds that an application may take, its start and end included."""

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(FLIGHT + 60),
    pytest.mark.wall_clock,
    needs_peer("AERODAAS_TEST_TELLO"),
]


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


@pytest.mark.parametrize("application", APPLICATIONS or sorted(WORLDS)[:1])
def test_what_the_tello_truly_did_meets_the_missions_criteria(
    application: str, tmp_path: Path
) -> None:
    """The shipped models find the person in H.264, and the Tello follows to the mission's end."""
    video = VideoOptions(width=640, height=480, rate=10.0)
    environment = EnvironmentConfig.load(ROOT / f"apps/environments/{WORLDS[application]}.json")
    options = TelloOptions(video=video).placed(environment)
    with EmulatedTello(options) as tello, TelloWitness(tello) as witness:
        recording = fly(application, tello, tmp_path)
    evidence = witness.evidence(recording)
    checks = [criterion(evidence) for criterion in MISSIONS[application].criteria]
    told = "\n".join(f"{check.holds:d} {check.what}: {check.found}" for check in checks)
    assert all(check.holds for check in checks), told

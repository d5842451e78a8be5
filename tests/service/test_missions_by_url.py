"""Applications flown by URL: unchanged but for the environment's name, and as they fly at home."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from served import Served, document, fleet, quick, robot

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

APPS = Path(__file__).parents[2] / "apps"
FARM = APPS / "environments" / "farm.json"
FLIGHT_SECONDS = 280


@pytest.fixture(scope="module")
def farm() -> Iterator[Served]:
    """The Farm Survey's environment, in simulated time."""
    with Served(quick(FARM), "--speed", "max") as served:
        yield served


def flown(*words: str, folder: Path, token: str = "") -> str:
    """Run the command line; returns what it prints."""
    ended = subprocess.run(
        [sys.executable, "-m", "aerodaas", *words],
        cwd=folder,
        env={"PATH": "/usr/bin:/bin", "HOME": str(folder), "AERODAAS_TOKEN": token},
        capture_output=True,
        text=True,
        timeout=FLIGHT_SECONDS,
        check=False,
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def states(path: Path) -> np.ndarray[Any, Any]:
    """Time and place of the drone, state by state."""
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording)
    return np.array(next(iter(flight.robots.values())).states)


@pytest.mark.timeout(600)
def test_the_farm_survey_flies_by_url_as_it_flies_at_home(farm: Served, tmp_path: Path) -> None:
    """With one seed in simulated time, the same trajectory to the last digit, and its recording."""
    app = str(APPS / "farm_survey.py")
    token = farm.user("asha", "growers")
    words = ("submit", app, "--to", farm.url, "--seed", "11", "--record", str(tmp_path / "url"))
    flown(*words, folder=tmp_path, token=token)
    environment = tmp_path / "farm.json"
    environment.write_text(json.dumps(quick(FARM)))
    home = ("run", app, "--env", str(environment), "--seed", "11", "--speed", "max", "--no-view")
    flown(*home, "--record", str(tmp_path / "home"), folder=tmp_path)
    theirs = states(tmp_path / "url" / "flight.mcap")
    ours = states(tmp_path / "home" / "flight.mcap")
    assert np.array_equal(theirs, ours, equal_nan=True)
    (mission,) = farm.ask("GET", "/v1/missions", token=token)
    assert mission["phase"] == "landed"
    assert mission["verdict"]["approved"]
    status, picture = farm.send("GET", mission["verdict"]["picture"], token=token)
    assert status == 200
    assert picture.startswith(b"\x89PNG")
    (used,) = farm.ask("GET", "/v1/usage", token=token)
    status = mission["status"]["quadrotor_base"]
    assert used["distance"] == pytest.approx(status["mission"]["distance"])


@pytest.fixture(scope="module")
def campus() -> Iterator[Served]:
    """Three drones, and missions that are rehearsed."""
    robots = (robot("one"), robot("two", 10), robot("three", 20))
    with Served(fleet(*robots), "--speed", "max") as served:
        yield served


def test_what_the_rehearsal_refuses_never_flies(campus: Served) -> None:
    """A way over the fence, and one that the lease's area does not hold, with the reasons."""
    outside = {"document": document("one", (200, 0))}
    id_ = campus.ask("POST", "/v1/missions", outside)["id"]
    refused = campus.until_phase(id_)
    assert refused["phase"] == "refused"
    assert refused["reason"]
    assert not refused["started"]
    area = [[-5, -5], [5, -5], [5, 5], [-5, 5]]
    lease = campus.ask("POST", "/v1/leases", {"robots": ["one"], "area": area})
    body = {"document": document("one", (15, 0)), "lease": lease["id"]}
    inside = campus.until_phase(campus.ask("POST", "/v1/missions", body)["id"])
    assert inside["phase"] == "refused"
    campus.ask("DELETE", f"/v1/leases/{lease['id']}")


@pytest.mark.timeout(600)
def test_two_users_fly_at_once_and_one_watches(campus: Served) -> None:
    """Each on a drone of their own; a tenant with whom a mission is shared sees it, and no more."""
    first, second = campus.user("first", "alpha"), campus.user("second", "beta")
    far = ((20.0, 20.0), (0.0, 20.0), (20.0, 20.0), (0.0, 20.0))
    shared = {"document": document("one", *far), "share": ["beta"]}
    one = campus.ask("POST", "/v1/missions", shared, first)["id"]
    two = campus.ask("POST", "/v1/missions", {"document": document("two", *far)}, second)["id"]
    campus.until(lambda: campus.mission(one)["phase"] in {"flying", "landed"})
    assert campus.ask("GET", f"/v1/missions/{one}", token=second)["id"] == one
    assert campus.send("GET", f"/v1/missions/{two}", token=first)[0] == 404
    land = {"robot": "one", "command": "land"}
    assert campus.send("POST", f"/v1/missions/{one}/commands", land, second)[0] in {403, 409}
    for id_ in (one, two):
        ended = campus.until_phase(id_)
        assert ended["phase"] == "landed", ended["reason"]
    assert {use["mission"] for use in campus.ask("GET", "/v1/usage", token=first)} == {one}

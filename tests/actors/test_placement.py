"""Over several Ray nodes of this machine, actors land where the environment file says."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

PROGRAM = Path(__file__).with_name("two_nodes.py")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def told(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a flight over two edges and two clouds told."""
    folder = tmp_path_factory.mktemp("cluster")
    done = subprocess.run(
        [sys.executable, str(PROGRAM), str(folder)],
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def test_each_analysis_runs_where_it_was_deployed(told: dict[str, Any]) -> None:
    """By kind, and by the name of one node."""
    places = told["places"]
    assert places["edge"] == "edge-a"
    assert places["edge-b"] == "edge-b"
    assert places["cloud"] in {"cloud-a", "cloud-b"}
    assert places["cloud-b"] == "cloud-b"


def test_each_resource_has_the_hardware_of_its_nodes(told: dict[str, Any]) -> None:
    """A kind that of all its nodes, a named node its own."""
    hardware = told["hardware"]
    assert {name: hardware[name]["nodes"] for name in hardware} == {
        "edge": 2,
        "cloud": 2,
        "second": 1,
        "beside": 1,
    }
    assert hardware["cloud"]["cores"] == 2
    assert hardware["cloud"]["memory"] > hardware["second"]["memory"] > 0
    assert hardware["second"]["accelerators"] == {"GPU": 2, "T4": 1}
    assert hardware["cloud"]["accelerators"] == {"GPU": 2, "T4": 1}
    assert hardware["edge"]["accelerators"] == hardware["beside"]["accelerators"] == {}


def test_the_drone_its_sensors_and_its_recorder_share_one_edge(told: dict[str, Any]) -> None:
    """Though another edge has room."""
    assert {told["places"][who] for who in ("drone/drone", "edge")} == {"edge-a"}


def test_frames_reach_every_node(told: dict[str, Any]) -> None:
    """Wherever an analysis runs, it has a result for most of them."""
    sent = {stream: count for stream, count in told["sent"].items() if "alerts" not in stream}
    assert set(sent) == {"drone/cam", *(f"drone/at_{name}" for name in told["expected"])}
    assert min(sent.values()) > 10
    assert max(sent.values()) == sent["drone/cam"]


def test_a_place_that_nobody_offers_is_refused_and_leaves_nothing_behind(
    told: dict[str, Any],
) -> None:
    """The message names what there is; no actor stays in the cluster."""
    unknown, wrong = told["refusals"]
    assert "no node of the cluster is called 'cloud-z'" in unknown
    assert "edge-a (" in unknown
    assert "'cloud-a' does not offer 'edge'" in wrong
    assert told["left"] == []

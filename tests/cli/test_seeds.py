"""Many seeds by one command: each run is that of its seed alone, and none disturbs another."""

from __future__ import annotations

import csv
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from command_line import exit_code
from flying import FLAT, Flyer, hop, recorded

from aerodaas.cli.flying.seeds.figures import rows
from aerodaas.cli.flying.seeds.runs import SeededRun
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = pytest.mark.wall_clock

# A shell starts what a script runs in its background with Ctrl-C ignored.
_MAIN = """
import signal
from aerodaas.cli.app import main
signal.signal(signal.SIGINT, signal.SIG_IGN)
main()
"""
HOP = """
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
if env.config.simulation.seed == 4:
    raise RuntimeError("unlucky")
drone = env.get_robot_by_id("drone")
print("flying")
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("wp0", %s, 0, 2)]))
drone.start_mission()
"""


def run(folder: Path, *words: str) -> int:
    """`aerodaas run --seeds`; returns the exit code."""
    seeds = ["--seeds", "3", "--seed", "3", "--record", str(folder / "out")]
    return exit_code("run", str(folder / "app.py"), *seeds, *words)


def test_each_run_is_that_of_its_seed_alone(
    flyer: Flyer, capsys: pytest.CaptureFixture[str]
) -> None:
    """Side by side a seed flies as it does alone, to the last bit; one that fails is told."""
    folder = flyer.folder
    flyer.write(FLAT)
    (folder / "app.py").write_text(HOP % 4)
    files = ["--json", str(folder / "table.json"), "--csv", str(folder / "table.csv")]
    assert run(folder, *files) == 1
    told = capsys.readouterr()
    assert "seed 4 failed: RuntimeError: unlucky" in told.out
    assert "1 of 3 runs failed: seeds 4" in told.err

    alone = recorded(
        flyer.fly(lambda env: env.get_robot_by_id("drone").navigate(hop((4, 0))), seed=5)
    )
    flown = {}
    for seed in (3, 5):
        with Recording.open(folder / "out" / f"seed-{seed}" / "flight.mcap") as recording:
            flown[seed] = RecordedFlight.read(recording).robots["drone"]
    assert np.array_equal(flown[5]._columns, alone.robots["drone"]._columns)
    assert not np.array_equal(flown[5]._columns, flown[3]._columns)
    assert (folder / "out" / "seed-3" / "output.txt").read_text().startswith("flying")

    rows = json.loads((folder / "table.json").read_text())
    assert [row["seed"] for row in rows] == [3, 4, 5]
    assert [row["outcome"].partition(":")[0] for row in rows] == ["landed", "failed", "landed"]
    assert rows[1]["flight s"] is None
    assert rows[2]["distance m"] == pytest.approx(alone.robots["drone"].distance, abs=1e-3)
    with (folder / "table.csv").open() as file:
        assert [row["waypoints"] for row in csv.DictReader(file)] == ["1", "", "1"]


def test_seeds_of_an_application_with_a_remote_user_share_no_port(flyer: Flyer) -> None:
    """All of them fly: nobody steers seeds that fly side by side, so that none of them listens."""
    flyer.write(FLAT)
    remote = "from aerodaas.analytics import RemoteAnalytics" + HOP % 4
    deployed = "RemoteAnalytics(env.env_data).deploy(env.get_compute_resource_by_id('edge'))"
    remote = remote.replace("drone.start", f"{deployed}.instantiate()\ndrone.start")
    (flyer.folder / "app.py").write_text(remote.replace("seed == 4", "seed == 40"))
    assert run(flyer.folder, "--jobs", "3") == 0


def test_a_row_tells_what_became_of_the_scheduler_s_tasks() -> None:
    """Of all that ended, how many in time; of those begun, how many in the cloud."""
    counts = {"edge": 30, "cloud": 10, "done": 33, "late": 2, "timeout": 1, "failed": 1,
              "drop": 4, "dropped": 9, "retry": 3}  # fmt: skip
    summary: dict[str, Any] = {"robots": {}, "alerts": [], "detections": {}, "utility": {}}
    busy, idle = (
        SeededRun(seed, Path("runs"), summary={**summary, "decisions": decisions})
        for seed, decisions in enumerate((counts, {}))
    )
    first, second = rows([busy, idle])
    assert (first["in time %"], first["in the cloud %"]) == (66.0, 25.0)
    assert (second["in time %"], second["in the cloud %"]) == (None, None)


def test_wrong_input_is_told_once(flyer: Flyer, capsys: pytest.CaptureFixture[str]) -> None:
    """What is wrong with every seed ends all runs at once, as one run would."""
    flyer.write(FLAT)
    (flyer.folder / "app.py").write_text(HOP % "float('nan')")
    assert run(flyer.folder, "--jobs", "1") == 2
    assert "app.py:" in capsys.readouterr().err
    assert [path.name for path in (flyer.folder / "out").iterdir()] == ["seed-3"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--seeds", "2", "--speed", "1"], "leave --speed out"),
        (["--seeds", "2", "--live"], "leave it out"),
        (["--seeds", "2", "--show", "ros2"], "leave it out"),
        (["--seeds", "2", "--record", "flight.mcap"], "names a folder"),
        (["--jobs", "2"], "belongs to --seeds"),
    ],
)
def test_what_does_not_go_together(
    words: list[str], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Options of one flight alone, or of several alone, are refused with the remedy."""
    (tmp_path / "app.py").write_text("")
    assert exit_code("run", str(tmp_path / "app.py"), *words) == 2
    assert told in capsys.readouterr().err


def test_an_interruption_lands_all_and_leaves_nothing(flyer: Flyer) -> None:
    """After Ctrl-C each drone lands, each recording is closed, and no process of theirs is left."""
    folder = flyer.folder
    flyer.write(FLAT)
    (folder / "app.py").write_text(HOP % 900)
    words = ["run", "app.py", "--seeds", "3", "--record", "out", "--jobs", "2"]
    with subprocess.Popen(
        [sys.executable, "-c", _MAIN, *words],
        cwd=folder,
        env={**os.environ, "SEEDS_OF": str(folder)},
        stderr=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
    ) as process:
        places = [folder / "out" / f"seed-{seed}" for seed in (0, 1)]
        while not all(_flies(place) for place in places):
            assert process.poll() is None
            time.sleep(0.1)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    for place in places:
        summary = json.loads((place / "summary.json").read_text())
        assert summary["complete"]
        outcome = summary["robots"]["drone"]["outcome"]
        assert outcome == "landed: interrupted from the keyboard"
    assert not (folder / "out" / "seed-2").exists()
    psutil.wait_procs(left := _processes_of(folder), timeout=5)
    assert not any(process.is_running() for process in left)


def _flies(place: Path) -> bool:
    """Whether there is a recording that has begun: some data beyond its head."""
    path = place / "flight.mcap"
    return path.exists() and path.stat().st_size > 20_000


def _processes_of(folder: Path) -> list[psutil.Process]:
    """Processes that the command in `folder` has started."""
    found = psutil.process_iter(["environ"])
    return [one for one in found if (one.info["environ"] or {}).get("SEEDS_OF") == str(folder)]

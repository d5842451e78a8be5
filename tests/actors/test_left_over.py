"""What applications leave that are killed, or run beside each other: nothing, in the end."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil
import pytest
from flying import FLAT
from waiting import until

from aerodaas.actors.cluster.local_ray import LocalRay
from aerodaas.actors.cluster.ray_process import LOCKS, VARIABLE
from aerodaas.actors.private_folder import private_folder
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

_ROOT = Path(__file__).resolve().parents[2]
_APP = """
from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
drone.get_sensor_by_id("odom_drone").get_data_stream()
hover = Waypoint("there", 4, 0, 2, hover_duration={hover})
drone.navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, [hover]))
drone.start_mission()
"""


def write(folder: Path, hover: float) -> None:
    """An application that hovers for so many seconds."""
    folder.mkdir(exist_ok=True)
    (folder / "environment.json").write_text(json.dumps(FLAT))
    (folder / "app.py").write_text(_APP.format(hover=hover))


@contextmanager
def started(folder: Path, command: str, *words: str) -> Iterator[subprocess.Popen[str]]:
    """`aerodaas COMMAND` with these words, in a session of its own."""
    with subprocess.Popen(
        [sys.executable, "-m", "aerodaas", command, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(_ROOT)},
        start_new_session=True,
    ) as process:
        yield process
        process.kill()


def actors(pid: int) -> set[psutil.Process]:
    """All actors below a process."""
    found = set()
    for one in psutil.Process(pid).children(recursive=True):
        with contextlib.suppress(psutil.Error):
            if " ".join(one.cmdline()).startswith("ray::") and "Actor" in one.cmdline()[0]:
                found.add(one)
    return found


def gone(processes: set[psutil.Process]) -> bool:
    """Whether none of them runs any more."""
    return not any(one.is_running() for one in processes)


def stream_folders(processes: set[psutil.Process]) -> set[Path]:
    """Folders with the sockets of these processes' streams."""
    found = set()
    for process in processes:
        with contextlib.suppress(psutil.Error):
            sockets = process.net_connections("unix")
            found |= {Path(one.laddr).parent for one in sockets if isinstance(one.laddr, str)}
    return {path for path in found if private_folder("streams") in path.parents}


def folders(processes: set[psutil.Process]) -> set[Path]:
    """Folders of their Rays."""
    found = set()
    for process in processes:
        with contextlib.suppress(psutil.Error):
            found.add(process.environ().get(VARIABLE, ""))
    return {Path(one) for one in found - {""}}


def under_way(pid: int) -> bool:
    """Whether the run of an application has begun: its orphan reaper holds the local Ray."""
    own = folders(set(psutil.Process(pid).children(recursive=True)))
    return any(any((folder / LOCKS).glob("*")) for folder in own)


def kill_in_flight(
    process: subprocess.Popen[str], recording: Path | None, also: str | None = None
) -> None:
    """Kill an application once it flies, and wait until all that it has started is gone.

    An actor of the class `also` is killed just before.
    """
    until(lambda: under_way(process.pid), 60.0)
    time.sleep(3.0)
    everyone = set(psutil.Process(process.pid).children(recursive=True))
    own = folders(everyone)
    streams = stream_folders(everyone)
    assert len(actors(process.pid)) >= 2
    assert len(own) == 1
    assert streams
    for one in actors(process.pid):
        if also is not None and also in one.cmdline()[0]:
            one.kill()
    process.kill()
    process.wait()
    until(lambda: gone(everyone), 60.0)
    until(lambda: not any(path.exists() for path in own), 20.0)
    assert not any(path.exists() for path in streams)
    if recording is not None:
        with Recording.open(recording) as written:
            assert written.complete


def test_killed_in_flight(tmp_path: Path) -> None:
    """The drone comes home by itself; then all of it ends, its recording closed."""
    write(tmp_path, hover=100_000)
    words = ("app.py", "--no-view", "--speed", "5", "--record", "out")
    with started(tmp_path, "run", *words) as process:
        kill_in_flight(process, tmp_path / "out" / "flight.mcap")


def test_killed_without_a_recording(tmp_path: Path) -> None:
    """The orphan reaper, which else lives in the recorder, has an actor of its own."""
    write(tmp_path, hover=100_000)
    words = ("app.py", "--no-view", "--speed", "5", "--set", "recording.enabled=false")
    with started(tmp_path, "run", *words) as process:
        kill_in_flight(process, None)


def test_killed_together_with_its_recorder(tmp_path: Path) -> None:
    """Ray restarts the recorder, and the orphan reaper in it, which has heard nobody."""
    write(tmp_path, hover=100_000)
    words = ("app.py", "--no-view", "--speed", "5", "--record", "out")
    with started(tmp_path, "run", *words) as process:
        kill_in_flight(process, None, "RecorderActor")


def test_several_applications_at_once(tmp_path: Path) -> None:
    """Each has a Ray of its own, and one that is killed takes nothing from the other."""
    names = ("one", "two", "three")
    with contextlib.ExitStack() as stack:
        running = {}
        for name in names:
            write(tmp_path / name, hover=20)
            words = ("app.py", "--no-view", "--speed", "1", "--record", "out")
            running[name] = stack.enter_context(started(tmp_path / name, "run", *words))
        recordings = {name: tmp_path / name / "out" / "flight.mcap" for name in names}
        until(lambda: all(under_way(one.pid) for one in running.values()), 120.0)
        time.sleep(3.0)
        everyone = {
            name: set(psutil.Process(one.pid).children(recursive=True))
            for name, one in running.items()
        }
        own = [folders(processes) for processes in everyone.values()]
        assert len(set().union(*own)) == len(names)
        running["one"].kill()
        for name in ("two", "three"):
            said, _ = running[name].communicate(timeout=120)
            assert running[name].returncode == 0, said
    until(lambda: all(map(gone, everyone.values())), 60.0)
    assert not any(path.exists() for found in own for path in found)
    for name, path in recordings.items():
        with Recording.open(path) as recording:
            assert recording.complete
            flight = RecordedFlight.read(recording)
        assert flight.robots["drone"].outcome.startswith("landed")
        assert (flight.robots["drone"].visited == ("there",)) is (name != "one")


def test_what_a_killed_keeper_left_is_pruned(tmp_path: Path) -> None:
    """The flight ends well; the next run's removes processes, folder and the sessions in it."""
    write(tmp_path, hover=8)
    words = ("app.py", "--no-view", "--speed", "1", "--record", "out")
    with started(tmp_path, "run", *words) as process:
        until(lambda: under_way(process.pid), 60.0)
        (keeper,) = (
            one
            for one in psutil.Process(process.pid).children()
            if any("ray_process.py" in word for word in one.cmdline())
        )
        left = {one for one in keeper.children(recursive=True) if VARIABLE in one.environ()}
        (folder,) = folders(left)
        assert (folder / "ray" / "session_latest").exists()
        keeper.kill()
        said, _ = process.communicate(timeout=120)
        assert process.returncode == 0, said
    with Recording.open(tmp_path / "out" / "flight.mcap") as recording:
        assert recording.complete
        assert RecordedFlight.read(recording).robots["drone"].visited == ("there",)
    assert any(one.is_running() for one in left)
    ray = LocalRay()
    try:
        assert ray.address
        assert gone(left)
        assert not folder.exists()
    finally:
        ray.end()

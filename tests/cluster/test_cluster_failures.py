"""What breaks on an edge-cloud while a drone is in the air, and what must not break with it."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import ray
from cluster_flights import ENVIRONMENT, Told, Watched, eventually
from flying import Flyer
from required import needs_root

from aerodaas.actors.cluster import ray_cluster as cluster
from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState
from tools.namespaces import EdgeCloud, Shape

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(240),
    needs_root,
    pytest.mark.wall_clock,
]
_HERE = Path(__file__).resolve().parent
_ROOT = _HERE.parents[1]

PLAIN = Shape(0.04, 50e6)
CLOUDS = 2


@pytest.fixture(scope="module")
def edge_cloud() -> Iterator[EdgeCloud]:
    """An edge and two cloud nodes, 40 ms and 50 Mbit/s away; Ray here is connected to them."""
    before = ray.is_initialized()
    if before:
        cluster.disconnect()
    paths = (_ROOT, _HERE, _ROOT / "tests", _ROOT / "tests/actors")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, paths)))
        with EdgeCloud(CLOUDS, shape=PLAIN) as made:
            cluster.connect(made.address)
            try:
                yield made
            finally:
                cluster.disconnect()
    if before:
        cluster.connect(None)


@pytest.fixture(autouse=True)
def _two_clouds(edge_cloud: EdgeCloud) -> None:
    """Replace what earlier tests broke for good: each finds the same, and may be run again."""
    for name in on(edge_cloud):
        if edge_cloud.is_cut(name):
            edge_cloud.kill(name)
    while len(on(edge_cloud)) < CLOUDS:
        name = f"cloud{len(edge_cloud.far) + 1}"
        edge_cloud.add(name, {"cloud": 1.0})
        edge_cloud.shape(name, PLAIN)
    addresses = {edge_cloud.far[name].address for name in on(edge_cloud)}
    eventually(lambda: _known_clouds() == addresses)


def _known_clouds() -> set[str]:
    """Addresses of the cloud nodes that live, as far as Ray knows."""
    nodes = (node for node in ray.nodes() if node["Alive"] and "cloud" in node["Resources"])
    return {node["NodeManagerAddress"] for node in nodes}


@pytest.fixture
def watched(edge_cloud: EdgeCloud, tmp_path: Path) -> Watched:
    """A flight to be broken."""
    return Watched(Flyer(tmp_path), edge_cloud)


def report(what: str, told: Told, watched: Watched, where: str = "") -> None:
    """State what a failure cost; shown with `pytest -rP`."""
    seconds = told.recovery(watched.broken_at, where)
    gap = told.longest_gap(watched.broken_at)
    print(  # noqa: T201
        f"{what}: next result in time after {seconds:.2f} s, longest without any {gap:.2f} s; "
        f"tasks: {told.summary()}"
    )


def on(nodes: EdgeCloud) -> list[str]:
    """The cloud's machines that have power."""
    return [name for name in nodes.clouds() if nodes.far[name].machine.alive]


def on_clouds(nodes: EdgeCloud, act: Callable[[str], None]) -> None:
    """Do something to every cloud node that has power."""
    for name in on(nodes):
        act(name)


def test_a_tenth_of_the_bandwidth_and_400_ms_more(watched: Watched) -> None:
    """A slow link costs tasks their deadlines, never the drone or the count."""
    with watched.flying():
        for shape in (Shape(0.04, 5e6), Shape(0.44, 50e6)):
            watched.broke()
            on_clouds(watched.cluster, lambda name: watched.cluster.shape(name, shape))  # noqa: B023
            watched.goes_on()
            time.sleep(4.0)
        on_clouds(watched.cluster, lambda name: watched.cluster.shape(name, PLAIN))
        watched.goes_on()
    told = Told.of(watched)
    report("400 ms more", told, watched)
    told.safe()
    told.each_counted_once()


def test_a_link_too_slow_for_any_frame(watched: Watched) -> None:
    """What must be late is not sent: a JPEG takes 2 s at 80 kbit/s, and its deadline is 0.9 s."""
    with watched.flying():
        watched.broke()
        on_clouds(watched.cluster, lambda name: watched.cluster.shape(name, Shape(0.04, 8e4)))
        time.sleep(30.0)
        on_clouds(watched.cluster, lambda name: watched.cluster.shape(name, PLAIN))
        mended = watched.now()
        watched.goes_on()
        time.sleep(20.0)
    told = Told.of(watched)
    report("80 kbit/s", told, watched)
    sent = told.sent_to_cloud(watched.broken_at, mended)
    late = [task for task in sent if told.ends[task][-1][1] != "done"]
    print(f"sent to the cloud meanwhile: {len(sent)}, of them not in time: {len(late)}")  # noqa: T201
    print(f"cloud used again {told.recovery(mended, 'cloud'):.1f} s after")  # noqa: T201
    told.safe()
    told.each_counted_once()
    assert len(late) <= 8
    assert not told.sent_to_cloud(watched.broken_at + 5.0, mended), "it is known to be too slow"
    assert told.recovery(mended, "cloud") < 20.0


def test_the_cloud_is_cut_off_for_ten_seconds(watched: Watched) -> None:
    """The edge goes on alone; afterwards the cloud is used again."""
    with watched.flying():
        watched.broke()
        on_clouds(watched.cluster, watched.cluster.cut)
        time.sleep(10.0)
        on_clouds(watched.cluster, watched.cluster.mend)
        mended = watched.now()
        watched.goes_on()
        time.sleep(12.0)
    told = Told.of(watched)
    report("cut off", told, watched, "edge")
    print(f"cloud used again {told.recovery(mended, 'cloud'):.1f} s after the link came back")  # noqa: T201
    told.safe()
    told.each_counted_once()
    assert told.recovery(watched.broken_at, "edge") < 10.0
    assert told.recovery(mended, "cloud") < 12.0


def test_an_analysis_is_killed(watched: Watched) -> None:
    """Ray restarts it, it is prepared anew, and what it lost is counted."""
    with watched.flying():
        watched.broke()
        watched.process("analytics/drone/glance").kill()
        eventually(lambda: watched.run.poll().reports["analytics/drone/glance"].phase == "failed")
        eventually(lambda: watched.run.poll().reports["analytics/drone/glance"].phase == "running")
        watched.goes_on()
    told = Told.of(watched)
    report("analysis killed", told, watched)
    told.safe()
    told.each_counted_once()
    assert told.alerts("actor_lost") == ["the actor analytics/drone/glance died"]
    assert any("glance is back after" in text for text in told.alerts("actor_back"))


def test_an_analysis_hangs(watched: Watched) -> None:
    """People are told, the cloud takes over, and what hung is used again once it answers."""
    with watched.flying():
        watched.broke()
        watched.stop.touch()
        time.sleep(8.0)
        watched.stop.unlink()
        watched.goes_on()
    told = Told.of(watched)
    report("analysis hung", told, watched, "cloud")
    told.safe()
    told.each_counted_once()
    assert any("does not answer on the edge" in text for text in told.alerts("executor_lost"))


def test_the_dispatcher_is_killed(watched: Watched) -> None:
    """Another takes its place; the frames in between are lost, and everyone can see which."""
    with watched.flying():
        watched.broke()
        watched.process("dispatcher").kill()
        eventually(lambda: watched.run.poll().reports["dispatcher"].phase == "failed")
        eventually(lambda: watched.run.poll().reports["dispatcher"].phase == "running")
        watched.goes_on()
    told = Told.of(watched)
    report("dispatcher killed", told, watched)
    told.safe()
    assert not {task: ends for task, ends in told.ends.items() if len(ends) > 1}
    missing = {int(task.rpartition("#")[2]) for task in told.missing()}
    assert missing
    assert max(missing) - min(missing) < len(missing) + 3, "lost in one stretch"
    assert told.alerts("actor_lost") == ["the actor dispatcher died"]
    assert any("dispatcher is back after" in text for text in told.alerts("actor_back"))


def test_the_recorder_is_killed(watched: Watched) -> None:
    """What it wrote can be read, and a second part goes on; the camera starts again with it."""
    with watched.flying():
        watched.broke()
        watched.process("edge").kill()
        eventually(lambda: watched.run.poll().reports["edge"].phase == "failed")
        eventually(lambda: watched.run.poll().reports["edge"].phase == "running")
        watched.goes_on()
    first = Told.of(watched)
    assert watched.run.recording is not None
    watched.run.recording = watched.run.recording.with_name("flight.2.mcap")
    second = Told.of(watched)
    report("recorder killed", second, watched)
    assert second.flight.robots["drone"].outcome.startswith("landed")
    # The camera shares the actor, so frames are counted anew; no task ends in both parts.
    ends = [
        {(task, end) for task, ends in one.ends.items() for end in ends} for one in (first, second)
    ]
    assert not ends[0] & ends[1]
    assert any("edge is back after" in text for text in second.alerts("actor_back"))


def test_the_heads_control_service_restarts(watched: Watched) -> None:
    """Actors that run go on without it; it comes back with what it knew."""
    with watched.flying():
        watched.broke()
        watched.cluster.restart_control_service()
        watched.goes_on()
        time.sleep(5.0)
        watched.goes_on()
    told = Told.of(watched)
    report("control service restarted", told, watched)
    told.safe()
    told.each_counted_once()
    assert {"edge", "cloud"} <= set(ray.cluster_resources())


def test_the_object_store_is_full(watched: Watched) -> None:
    """Somebody's data fills it; frames to the cloud may fail, nothing else does."""
    with watched.flying():
        watched.broke()
        hoard = [ray.put(np.random.default_rng(i).bytes(20_000_000)) for i in range(9)]
        watched.goes_on()
        time.sleep(3.0)
        del hoard
        watched.goes_on()
    told = Told.of(watched)
    report("object store full", told, watched)
    told.safe()
    told.each_counted_once()
    assert not told.alerts("scheduler_failed")


def test_the_edges_disk_is_full(edge_cloud: EdgeCloud, tmp_path: Path) -> None:
    """The recording stops and says so; the flight does not, and then the run has failed."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(disk)]
    subprocess.run(mount, check=True)
    edge_cloud.edge.run(*mount)
    watched = Watched(Flyer(tmp_path), edge_cloud, {**ENVIRONMENT, "recording": {"images": "png"}})
    try:
        record = watched.flyer.folder / "flight"
        record.symlink_to(disk)
        with pytest.raises(MissionError, match="No space left"):
            _fly_until_full(watched)
        assert watched.run.state is not None
        assert watched.run.state.robots["drone"].mission.state is MissionState.LANDED
        assert "No space left" in watched.run.reports()["edge"].values["failure"]
    finally:
        subprocess.run(["umount", str(disk)], check=True)  # noqa: S607


def _fly_until_full(watched: Watched) -> None:
    with watched.flying(settle=0.0):
        eventually(lambda: bool(watched.run.poll().reports["edge"].values["failure"]))
        watched.goes_on()


def test_a_cloud_node_is_killed(watched: Watched) -> None:
    """Its work goes to the edge at once, and to another cloud node when Ray has noticed."""
    with watched.flying():
        (name,) = (n for n in on(watched.cluster) if _has_executor(watched.cluster, n))
        watched.broke()
        watched.cluster.kill(name)
        watched.goes_on()
        time.sleep(5.0)
        watched.goes_on()
    told = Told.of(watched)
    report("cloud node killed", told, watched, "edge")
    told.safe()
    told.each_counted_once()


def test_the_cloud_is_cut_off_for_good(watched: Watched) -> None:
    """The mission ends on the edge alone."""
    with watched.flying():
        watched.broke()
        on_clouds(watched.cluster, watched.cluster.cut)
        watched.goes_on(20)
        time.sleep(5.0)
        watched.goes_on(20)
    told = Told.of(watched)
    report("cut off for good", told, watched, "edge")
    told.safe()
    told.each_counted_once()


def _has_executor(nodes: EdgeCloud, name: str) -> bool:
    commands = (process.cmdline() for process in nodes.far[name].machine.processes())
    return any("CloudExecutor" in word for command in commands for word in command)

"""Failures in one flight over an edge-cloud, and how long each kept results away."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from _cluster_apps import Work, environment, flying, hover

from aerodaas.actors.run.flight import Flight
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.namespaces import EdgeCloud, Shape

__all__ = ["Recovery", "measure_recoveries"]

_RATE = 5.0
_SETTLE = 6.0
_LOOK = 15.0
"""Seconds after a failure in which results are looked for."""
_TASK = {"benefit": 10, "deadline": 900, "edge_time": 120, "cloud_time": 200, "cloud_cost": 1}


@dataclass(frozen=True)
class Recovery:
    """What one failure cost."""

    what: str
    back: float
    """Seconds to the next result in time from the edge, of a frame taken after the failure."""
    longest: float
    """Longest stretch without a result in time, seconds."""
    lost: int
    """Tasks that ended late, failed or timed out."""
    state_gap: float
    """Longest time between two of the drone's published states, milliseconds; 50 is the rule."""


def measure_recoveries(cluster: EdgeCloud, folder: Path, plain: Shape) -> list[Recovery]:
    """Break one thing after another in one flight; leaves the cluster without its last cloud."""
    content = environment(1, _RATE, (180, 108), cloud=True, tasks={"one": _TASK, "two": _TASK})
    content |= {"recording": {"images": "none"}}
    content["schedulers"]["analytics"] = "ec_edf"
    moments: list[tuple[str, float]] = []
    with flying(content, folder, cluster.address, record=folder / "failures") as env:
        frames = env.get_robot_by_id("drone0").get_sensor_by_id("camera0").get_data_stream()
        for name in ("one", "two"):
            work = Work(0.11, scheduled=True, name=name)
            work.deploy(env.get_compute_resource_by_id("edge")).analyse(frames)
        hover(env, "drone0")
        run = env.launch()
        time.sleep(3 * _SETTLE)
        for what, fail, mend in _failures(cluster, run, plain):
            moments.append((what, run.poll().robots["drone0"].mission.stamp / 1e9))
            fail()
            time.sleep(_LOOK)
            mend()
            time.sleep(_SETTLE)
    assert run.recording is not None  # noqa: S101 - asked for
    with Recording.open(run.recording) as recording:
        flight = RecordedFlight.read(recording)
    return [_recovery(flight, what, at) for what, at in moments]


def _failures(
    cluster: EdgeCloud, run: Run, plain: Shape
) -> list[tuple[str, Callable[[], None], Callable[[], None]]]:
    def kill(actor: str) -> Callable[[], None]:
        flight = run._flight  # noqa: SLF001 - a benchmark may look inside
        assert isinstance(flight, Flight)  # noqa: S101 - on Ray
        infos = flight.infos()
        return lambda: cluster.edge.find(infos[actor].pid).kill()

    def everywhere(act: Callable[[str], None]) -> Callable[[], None]:
        def acted() -> None:
            for name in cluster.clouds():
                act(name)

        return acted

    def shape(wanted: Shape) -> Callable[[], None]:
        return everywhere(lambda name: cluster.shape(name, wanted))

    def nothing() -> None:
        return None

    tenth = Shape(plain.rtt, (plain.bandwidth or 1e8) / 10)
    slow = Shape(plain.rtt + 0.4, plain.bandwidth)
    return [
        ("nothing at all", nothing, nothing),
        ("an analysis is killed", kill("analytics/drone0/one"), nothing),
        ("the dispatcher is killed", kill("dispatcher"), nothing),
        ("the link at a tenth", shape(tenth), shape(plain)),
        ("400 ms more", shape(slow), shape(plain)),
        ("the control service restarts", cluster.restart_control_service, nothing),
        ("the cloud is cut off", everywhere(cluster.cut), everywhere(cluster.mend)),
        ("a cloud node is killed", lambda: cluster.kill(cluster.clouds()[0]), nothing),
    ]


def _recovery(flight: RecordedFlight, what: str, at: float) -> Recovery:
    seen = [one for one in flight.outcomes if at < one.time < at + _LOOK]
    done = [one.time for one in seen if one.action == "done"]
    states = flight.robots["drone0"].time
    near = states[(states > at) & (states < at + _LOOK)]
    return Recovery(
        what,
        back=min(done, default=float("inf")) - at,
        longest=float(np.diff([at, *done, at + _LOOK]).max()),
        lost=sum(one.action in {"late", "failed", "timeout"} for one in seen),
        state_gap=float(np.diff(near).max() * 1000) if len(near) > 1 else float("inf"),
    )

"""Where the time goes from an actor's death to the next result.

One drone and one analysis under a scheduler, on this machine alone. The dispatcher's process is
killed, and the one that takes its place is watched from outside: what it has come to, and what it
has computed by then, which a busy machine does not change.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import psutil
import typer
from _cluster_apps import Work, environment, flying, hover
from _report import Report

from aerodaas.actors.run.flight import Flight
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

UNITS = {"after": "s", "computed": "s"}
_RATE = 10.0
_SETTLE = 5.0
_PATIENCE = 60.0
_ACTOR = "dispatcher"
_TASK = {"benefit": 10, "deadline": 900, "edge_time": 50, "cloud_time": 200, "cloud_cost": 1}
_TITLE = "ray::NodeActor"
_TITLES = {"ray::IDLE": "Ray in it is ready", _TITLE: "our modules are loaded"}
"""How Ray calls a process that has come so far."""
Moment = tuple[str, float, float]
"""What has happened, seconds after the death, seconds of computing of the new process."""


def _ray_processes() -> dict[int, psutil.Process]:
    return {process.pid: process for process in psutil.Process().children(recursive=True)}


def _title(process: psutil.Process) -> str:
    with contextlib.suppress(psutil.Error, IndexError):
        return str(process.cmdline()[0])
    return ""


def _computed(process: psutil.Process) -> float:
    times = process.cpu_times()
    return float(times.user + times.system)


def _flight(run: Run) -> Flight:
    flight = run._flight  # noqa: SLF001 - a benchmark may look inside
    assert isinstance(flight, Flight)  # noqa: S101 - on Ray
    return flight


def _kill(run: Run) -> tuple[float, psutil.Process, list[Moment]]:
    """Kill the actor; return when, in host seconds, its successor, and how that came up."""
    infos = _flight(run).infos()
    before, actors = _ray_processes(), {info.pid for info in infos.values()}
    died = time.time()
    before[infos[_ACTOR].pid].kill()
    moments: list[Moment] = []
    began = 0.0
    while time.time() < died + _PATIENCE:
        for pid, process in _ray_processes().items():
            # Ray may have had the process ready before; then there is no moment of its beginning.
            title, fresh = _title(process), pid not in before
            if fresh:
                began = began or time.time()
            for mark, name in _TITLES.items() if fresh else ():
                if title.startswith(mark) and name not in [moment[0] for moment in moments]:
                    moments.append((name, time.time() - died, _computed(process)))
            if pid not in actors and title.startswith(_TITLE):
                begun = [("a process is there", began - died, 0.0)] if began else []
                return died, process, [*begun, *moments]
        time.sleep(0.005)
    raise TimeoutError(f"no other {_ACTOR} within {_PATIENCE:.0f} s")


def main(
    *,
    times: Annotated[int, typer.Option(min=1, max=3, help="How often to kill it.")] = 3,
    json_path: Annotated[Path | None, typer.Option("--json", help="Write the figures.")] = None,
) -> None:
    """Kill the dispatcher in flight and tell what its return is made of; medians.

    python benchmarks/restart.py --times 3
    """
    content = environment(1, _RATE, (180, 108), cloud=False, tasks={"one": _TASK})
    content |= {"recording": {"images": "none"}}
    content["schedulers"]["analytics"] = "edf"
    found: dict[str, list[tuple[float, float]]] = {}
    rounds = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with flying(content, folder, "", record=folder / "restarts") as env:
            frames = env.get_robot_by_id("drone0").get_sensor_by_id("camera0").get_data_stream()
            work = Work(0.03, scheduled=True, name="one")
            work.deploy(env.get_compute_resource_by_id("edge")).analyse(frames)
            hover(env, "drone0")
            run = env.launch()
            for _ in range(times):
                time.sleep(_SETTLE)
                died, process, moments = _kill(run)
                time.sleep(_SETTLE)
                rounds.append((died, _computed(process), moments))
            origin = _flight(run)._origin / 1e9  # noqa: SLF001 - as above
        assert run.recording is not None  # noqa: S101 - asked for
        with Recording.open(run.recording) as recording:
            flight = RecordedFlight.read(recording)
    for died, computed, moments in rounds:
        at = died - origin
        known = {kind: t for t, kind, _ in reversed(flight.alerts) if t > at}
        result = min(o.time for o in flight.outcomes if o.time > known["actor_back"])
        told = ("the application knows", known["actor_lost"] - at, float("nan"))
        last = ("it is set up", known["actor_back"] - at, float("nan"))
        for what, after, cpu in [told, *moments, last, ("the next result", result - at, computed)]:
            found.setdefault(what, []).append((after, cpu))
    report = Report(f"after the {_ACTOR}'s death", UNITS, packages=("ray",))
    for what, values in found.items():
        after, cpu = np.median(values, axis=0)
        report.row(what, {"after": float(after), "computed": float(cpu)})
    report.note("computed: by the new process until then; the last row's is some seconds later's")
    report.show()
    if json_path is not None:
        report.write(json_path)


if __name__ == "__main__":
    typer.run(main)

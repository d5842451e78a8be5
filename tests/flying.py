"""Flights of whole applications in the test's own process, without a terminal view."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.config.options import RunOptions, current_options
from aerodaas.environment.run import Run
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

if TYPE_CHECKING:
    from aerodaas.actors.run.flight import Flight

__all__ = ["FLAT", "Flyer", "flight_of", "hop", "recorded", "robot"]

_FAST = {"cruise_speed": 4.0, "max_speed": 6.0, "max_acceleration": 4.0, "takeoff_height": 1.5}


def robot(name: str = "drone", **settings: Any) -> dict[str, Any]:  # noqa: ANN401
    """A quick simulated drone with its odometry; `settings` go on top."""
    sensors = [{"id": f"odom_{name}", "type": "odometry", "rate": 10}]
    return {"id": name, "limits": _FAST, "sensors": sensors, **settings}


FLAT: dict[str, Any] = {
    "name": "flat",
    "robots": [robot()],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty", "wind": [0.5, 0.2, 0.0], "gust": 0.3},
}
"""One drone over flat ground, with wind and gusts, so that the seed matters."""


def hop(*places: tuple[float, float], hover: float = 0.0) -> AeroNavigation:
    """Waypoints at these places (east, north), two metres up."""
    stops = [Waypoint(f"wp{i}", x, y, 2.0, hover_duration=hover) for i, (x, y) in enumerate(places)]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops)


class Flyer:
    """Makes environments in a folder of the test's own and flies them."""

    def __init__(self, folder: Path, start_ray: Callable[[], object] | None = None) -> None:
        """Write into `folder`; `start_ray` is called before a flight that goes by the clock."""
        self.folder = folder
        self._start_ray = start_ray

    def write(self, content: dict[str, Any], name: str = "environment.json") -> Path:
        """Write an environment file."""
        path = self.folder / name
        path.write_text(json.dumps(content))
        return path

    @contextmanager
    def options(self, **words: Any) -> Iterator[None]:  # noqa: ANN401
        """Options of the runs made inside, as `aerodaas run` would set them; without plots."""
        if words.get("speed") is not None or words.get("simulated_time") is False:
            self._begin_ray()
        record = self.folder / "flight"
        token = current_options.set(RunOptions(**{"view": False, "record": record, **words}))
        try:
            with (
                patch("aerodaas.terminal.console.show_results"),
                patch("aerodaas.terminal.console.show_speed"),
            ):
                yield
        finally:
            current_options.reset(token)

    def fly(
        self,
        build: Callable[[Environment], object],
        content: dict[str, Any] | None = None,
        **words: Any,  # noqa: ANN401
    ) -> Run:
        """Fly what `build` made of a fresh environment to its end; raises what it ended with.

        `build` must call `navigate`; `words` are fields of RunOptions.
        """
        with self.flying(build, content, **words) as environment:
            return environment.launch()

    @contextmanager
    def flying(
        self,
        build: Callable[[Environment], object],
        content: dict[str, Any] | None = None,
        **words: Any,  # noqa: ANN401
    ) -> Iterator[Environment]:
        """Fly as `fly` does, and let the test act in flight; its end waits for the mission's."""
        content = content or FLAT
        path = self.write(content)
        if any(robot.get("driver", "simulated") != "simulated" for robot in content["robots"]):
            self._begin_ray()
        with self.options(**words):
            environment = Environment(path)
            build(environment)
            run = environment.launch()
            try:
                yield environment
            except BaseException:
                run.abandon()
                raise
            run.wait()

    def _begin_ray(self) -> None:
        if self._start_ray is not None:
            self._start_ray()


def flight_of(run: Run) -> Flight:
    """The flight of a run on Ray."""
    from aerodaas.actors.run.flight import Flight  # noqa: PLC0415 - loads ray

    assert isinstance(run._flight, Flight)
    return run._flight


def recorded(run: Run) -> RecordedFlight:
    """What the recording of a finished run holds; it must have been closed properly."""
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        assert recording.complete
        return RecordedFlight.read(recording)

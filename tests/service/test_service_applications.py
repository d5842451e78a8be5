"""Applications flown at a provider's service by its URL, from their file to their recording."""

from __future__ import annotations

import enum
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from served import Served, fleet, robot

from aerodaas import AeroNavigation, Analytics, Environment, NavigationType, Waypoint
from aerodaas.config.options import RunOptions, current_options
from aerodaas.errors import MissionError
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.readings import Readings
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

APPS = Path(__file__).resolve().parents[2] / "apps"
FARM = APPS / "environments" / "farm.json"


def flown(path: Path) -> RecordedFlight:
    """What a whole recording holds."""
    with Recording.open(path) as recording:
        assert recording.complete
        return RecordedFlight.read(recording)


@pytest.fixture(scope="module")
def campus() -> Iterator[Served]:
    """A service with one drone that flies in real time, without a rehearsal."""
    with Served(fleet(robot("north")), "--no-rehearse") as service:
        yield service


@pytest.fixture(autouse=True)
def _quiet(own_logins: None, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    monkeypatch.setattr("aerodaas.terminal.console.show_results", lambda *_, **__: None)


def provided(service: Served, folder: Path, **changes: Any) -> Environment:  # noqa: ANN401
    """The service's environment, recorded into a folder."""
    current_options.set(RunOptions(view=False, record=folder, **changes))
    return Environment(service.url, token=service.token)


def hop(*places: tuple[float, float], name: str = "wp") -> AeroNavigation:
    """Waypoints at these places, 2 m up."""
    stops = [Waypoint(f"{name}{n}", x, y, 2.0) for n, (x, y) in enumerate(places)]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops)


def test_a_flight_obeys_its_application_over_the_wire(campus: Served, tmp_path: Path) -> None:
    """Streams are read, the mission paused and resumed, a waypoint added, the drone landed."""
    environment = provided(campus, tmp_path / "out")
    drone = environment.get_robot_by_id("north")
    odometry = drone.get_sensor_by_id("odometry").get_data_stream()
    drone.navigate(hop((0, 12)))
    drone.start_mission(wait=False)
    first = next(odometry)
    assert isinstance(first, Odometry)
    drone.pause_mission()
    drone.resume_mission()
    drone.navigate(hop((3, 12), name="further"))
    assert sum(1 for _ in odometry) > 10
    environment.wait()
    (flight,) = flown(tmp_path / "out" / "flight.mcap").robots.values()
    assert flight.visited == ("wp0", "further0")
    with pytest.raises(MissionError, match="no longer flying"):
        drone.pause_mission()


class Heights(Analytics[Readings]):
    """An analysis of the application's own."""

    def process(self, item: Odometry, context: Any) -> Readings:  # noqa: ANN401
        """Tell the height."""
        return Readings(context.now(), {"height": float(item.position[2])})


def test_an_analysis_of_ones_own_stays_at_the_users_side(campus: Served, tmp_path: Path) -> None:
    """Its results are a stream of the flight, and are recorded there."""
    environment = provided(campus, tmp_path / "out")
    drone = environment.get_robot_by_id("north")
    heights = Heights().deploy(environment.here)
    stream = heights.analyse(drone.get_sensor_by_id("odometry").get_data_stream())
    drone.navigate(hop((0, 3)))
    drone.start_mission(wait=False)
    told = [one.values["height"] for one in stream]
    environment.wait()
    assert max(told) > 1.5
    with Recording.open(tmp_path / "out" / "flight.mcap") as recording:
        assert any("heights" in topic for topic in recording.topics)


class Colour(enum.Enum):
    """What an item of a class of one's own may hold."""

    RED = "red"


@dataclass(frozen=True)
class Mark:
    """An item of a class of one's own."""

    place: Odometry
    colour: Colour


class Marks(Analytics[Mark]):
    """Marks each place."""

    accepts = (Odometry,)

    def process(self, item: Odometry, context: object) -> Mark:
        """Mark it."""
        del context
        return Mark(item, Colour.RED)


def test_items_of_ones_own_class_are_read_as_they_were_made(campus: Served, tmp_path: Path) -> None:
    """As in a flight of one's own, though the provider knows nothing of the class."""
    environment = provided(campus, tmp_path)
    drone = environment.get_robot_by_id("north")
    marks = Marks().analyse(drone.get_sensor_by_id("odometry").get_data_stream())
    drone.navigate(hop((0.0, 3.0)))
    environment.start_mission(wait=False)
    found = marks.get_data(60.0)
    environment.wait()
    assert type(found) is Mark
    assert found.colour is Colour.RED
    assert isinstance(found.place, Odometry)

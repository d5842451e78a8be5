"""Video at waypoints: begun and ended where the drone has arrived, and ended with the mission."""

from __future__ import annotations

from dataclasses import dataclass, field

import pytest
from flights import PERIOD, Flight, KinematicVehicle, add, flight
from surveyors import Camera, Surveyor, patience, surveying

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import Payload, PhotoOutcome, VideoCamera
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import equipment_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, End, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

BEGIN = Waypoint("north", 0, 5, 2, video=True)
FINISH = Waypoint("east", 5, 5, 2, video=False)
PLAIN = Waypoint("east", 5, 5, 2)


def camera_of(vehicle: Surveyor) -> Camera:
    """Its camera."""
    assert vehicle.photo_camera is not None
    return vehicle.photo_camera


def begun(vehicle: KinematicVehicle, *waypoints: Waypoint) -> Flight:
    """A flight over `waypoints` that has 4 s for the camera."""
    options = patience(4.0)
    return flight(add(*(waypoints or (BEGIN, FINISH))), vehicle=vehicle, options=options)


def flown(vehicle: KinematicVehicle, *waypoints: Waypoint) -> Flight:
    """The same, flown whole."""
    made = begun(vehicle, *waypoints)
    made.run()
    made.expect(MissionState.LANDED)
    return made


def told(made: Flight) -> list[str]:
    """What people were told of video."""
    return [alert.text for alert in made.mission.alerts if alert.kind == "video"]


def test_a_video_begins_and_ends_where_it_is_to() -> None:
    """Once the drone has arrived, and not again."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    made = begun(vehicle)
    made.run(until=lambda: bool(camera.filmed))
    assert abs(vehicle.position[1] - 5) < 0.6
    made.run(until=lambda: len(camera.filmed) == 2)
    assert abs(vehicle.position[0] - 5) < 0.6
    made.run()
    made.expect(MissionState.LANDED)
    assert list(made.status.visited) == ["north", "east"]
    assert camera.filmed == [True, False]
    assert not told(made)


def test_the_picture_comes_before_the_video() -> None:
    """So that what is filmed is what the gimbal looks at."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.silent = True
    made = begun(vehicle, Waypoint("north", 0, 5, 2, photo=True, video=True))
    made.run(until=lambda: bool(camera.asked))
    made.run(2.0)
    assert camera.filmed == []
    camera.silent = False
    made.run()
    assert camera.filmed[0] is True


def test_a_silent_camera_is_waited_for_no_longer_than_its_time() -> None:
    """The drone stays that long, flies on, and it is ended at the end: it may have heard."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.films = False
    made = begun(vehicle, BEGIN)
    made.run(until=lambda: bool(camera.filmed))
    began = made.seconds
    made.run(until=lambda: made.mission.state is not MissionState.LOITERING)
    assert 3.9 < made.seconds - began < 4.5
    made.run()
    made.expect(MissionState.LANDED)
    assert camera.filmed == [True, False]
    silent = "video not begun at north: the camera did not acknowledge it within 4 s"
    assert told(made) == [silent]


def test_a_refusal_is_told_and_the_flight_goes_on() -> None:
    """Nothing is ended that has not begun."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.film_refuses = "denied"
    made = flown(vehicle, BEGIN, PLAIN)
    assert list(made.status.visited) == ["north", "east"]
    assert told(made) == ["video not begun at north: denied"]
    assert camera.filmed == [True]


def test_a_refused_end_is_told_and_tried_again_at_the_end() -> None:
    """The recording is the mission's until it has ended."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    made = begun(vehicle)
    made.run(until=lambda: camera.filming is True)
    camera.film_refuses = "denied"
    made.run(until=lambda: bool(told(made)))
    assert told(made) == ["video not ended at east: denied"]
    camera.film_refuses = ""
    made.run()
    made.expect(MissionState.LANDED)
    assert camera.filmed == [True, False, False]


@pytest.mark.parametrize("aborted", [False, True])
def test_a_video_ends_with_the_mission_that_has_begun_it(*, aborted: bool) -> None:
    """Landed or aborted, and not before."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    made = begun(vehicle, BEGIN, PLAIN)
    made.run(until=lambda: camera.filming is True)
    if aborted:
        made.run(1.0)
        vehicle.kill()
    else:
        made.mission.handle(End("enough"), vehicle.read().stamp)
        made.run_to(MissionState.LANDING)
        made.turn()
    assert camera.filming is True
    made.run()
    made.expect(MissionState.ABORTED if aborted else MissionState.LANDED)
    assert camera.filmed == [True, False]


def test_a_video_that_ran_before_is_left_alone() -> None:
    """Unless a waypoint ends it."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.filming = True
    flown(vehicle, BEGIN, PLAIN)
    assert camera.filmed == [True]
    flown(vehicle := Surveyor(), PLAIN)
    assert camera_of(vehicle).filmed == []


def test_a_camera_that_belies_its_word_is_told_once() -> None:
    """After it has acknowledged, or much later; it is ended all the same."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    made = begun(vehicle, BEGIN, PLAIN)
    made.run(until=lambda: camera.filming is True)
    made.run(1.0)
    camera.filming, camera.film_fault = False, "the camera says that it is not recording"
    made.run()
    made.expect(MissionState.LANDED)
    assert told(made) == ["video begun at north, but the camera says that it is not recording"]
    assert camera.filmed == [True, False]


def test_an_order_that_another_one_overtakes_is_told() -> None:
    """A more urgent waypoint comes while the camera has not answered."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.films = False
    made = begun(vehicle, BEGIN)
    made.run(until=lambda: bool(camera.filmed))
    camera.films = True
    urgent = Waypoint("urgent", 0, 5, 2, video=False, priority=1)
    made.mission.handle(add(urgent), vehicle.read().stamp)
    made.run()
    made.expect(MissionState.LANDED)
    overtaken = "the camera was told otherwise before it acknowledged it"
    assert told(made) == [f"video not begun at north: {overtaken}"]
    assert camera.filmed == [True, False]


def test_what_may_have_begun_is_ended_though_it_is_refused_later() -> None:
    """The camera was silent at first, and then refuses to begin again."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    camera.films = False
    made = begun(vehicle, BEGIN, Waypoint("east", 5, 5, 2, video=True))
    made.run(until=lambda: bool(told(made)))
    camera.film_refuses = "denied"
    made.run()
    made.expect(MissionState.LANDED)
    assert camera.filmed == [True, True, False]


class Broken(Camera):
    """Raises where it should tell of a fault, once it has been told something."""

    def __getattribute__(self, name: str) -> object:
        if name == "film_fault" and super().__getattribute__("filmed"):
            raise ValueError("nonsense")
        return super().__getattribute__(name)


def test_a_driver_that_raises_ends_no_flight() -> None:
    """It is told."""
    vehicle = Surveyor()
    vehicle.photo_camera = Broken(vehicle.clock, None)
    made = flown(vehicle, BEGIN, PLAIN)
    assert list(made.status.visited) == ["north", "east"]
    assert told(made)[0].startswith("video not begun at north: ValueError: nonsense")


@dataclass
class PhotoOnly:
    """Takes pictures."""

    asked: list[str] = field(default_factory=list)

    def take_photo(self, label: str) -> int:
        """Take one."""
        self.asked.append(label)
        return len(self.asked)

    def outcomes(self) -> list[PhotoOutcome]:
        """Nothing."""
        return []


class Raises(Camera):
    """Fails as a driver may."""

    def film(self, on: bool) -> None:  # noqa: FBT001
        """Fail."""
        del on
        raise self.error

    error: Exception = ValueError("no card")


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        ("none", "the vehicle has no camera, or none that answers"),
        ("photo", "the camera records no video"),
        ("refuses", "no card is in it"),
        ("raises", "ValueError: no card"),
        ("vehicle", "the vehicle has no camera, or none that answers"),
    ],
)
def test_what_is_not_there_is_told_at_once(fault: str, why: str) -> None:
    """The waypoint counts as visited; nothing is ended at the end."""
    vehicle: KinematicVehicle = Surveyor()
    if isinstance(vehicle, Surveyor):
        raising = Raises(vehicle.clock, None)
        if fault == "refuses":
            raising.error = VehicleError("no card is in it")
        replaced: dict[str, object] = {"none": None, "photo": PhotoOnly()}
        vehicle.photo_camera = replaced.get(fault, raising)  # type: ignore[assignment]
    if fault == "vehicle":
        vehicle = KinematicVehicle()
    made = flown(vehicle, BEGIN)
    assert list(made.status.visited) == ["north"]
    (text,) = told(made)
    assert text.startswith(f"video not begun at north: {why}")


def test_a_camera_that_vanishes_ends_nothing_but_its_own_order() -> None:
    """Acknowledged, it says no more; not acknowledged, it is told at once."""
    vehicle = Surveyor()
    camera = camera_of(vehicle)
    made = begun(vehicle, BEGIN, PLAIN)
    made.run(until=lambda: camera.filming is True)
    made.turn()
    vehicle.photo_camera = None
    made.run()
    made.expect(MissionState.LANDED)
    gone = "the vehicle has no camera, or none that answers"
    assert told(made) == [f"video not ended at the end of the mission: {gone}"]
    vehicle = Surveyor()
    camera_of(vehicle).films = False
    made = begun(vehicle, BEGIN)
    camera = camera_of(vehicle)
    made.run(until=lambda: bool(camera.filmed))
    made.turn()
    vehicle.photo_camera = None
    made.turn()
    assert told(made) == [f"video not begun at north: {gone}"]


def test_a_simulated_camera_records_between_its_waypoints() -> None:
    """From the first to the second; nothing is told."""
    robot = surveying()
    environment = EnvironmentConfig.model_validate({"robots": [robot]})
    vehicle = SimulatedVehicle(robot, environment)
    vehicle.connect()
    payload = equipment_of(vehicle, Payload)
    assert payload is not None
    camera = payload.photo_camera
    assert isinstance(camera, VideoCamera)
    start = vehicle.read().odometry.position
    mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=start, vehicle=vehicle)
    loop = SetpointLoop(vehicle, mission)
    stops = [BEGIN, FINISH, Waypoint("west", 0, 0, 2, video=True)]
    mission.handle(AddNavigation(AeroNavigation(data=stops)), 0)
    mission.handle(Start(), 0)
    now, seen = 0, [(camera.filming, 0)]
    while not mission.finished and now < 300 * NANOSECONDS:
        loop.step(now)
        if camera.filming is not seen[-1][0]:
            seen.append((camera.filming, len(mission.status.visited)))
        now += PERIOD
        vehicle.advance_to(now)
    assert mission.state is MissionState.LANDED
    assert [filming for filming, _ in seen] == [False, True, False, True, False]
    assert [visited for _, visited in seen] == [0, 1, 2, 3, 3]
    assert not [alert for alert in mission.alerts if alert.kind == "video"]

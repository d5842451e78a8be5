"""The drone's actor by the clock: what its threads do while commands and reads come in."""

from __future__ import annotations

import itertools
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from drone_by_hand import DroneByHand, drone_by_hand
from drone_nodes import UnreadableVehicle, robot_spec
from flying import hop, robot

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import MissionError
from aerodaas.messages.mission import MissionState
from aerodaas.mission.commands import AddNavigation, ClearNavigation, End
from aerodaas.runtime.session import Session
from aerodaas.service.flights.folder import RobotLocks

pytestmark = pytest.mark.wall_clock

_READS = 100_000
_ON_GROUND = {MissionState.IDLE, MissionState.PREFLIGHT, MissionState.TAKING_OFF}
_HOLD = {"on_complete": "hold"}


def _square(name: str) -> AeroNavigation:
    places = [(3, 0), (3, 3), (0, 3), (0, 0)]
    stops = [Waypoint(f"{name}-{i}", x, y, 2.0) for i, (x, y) in enumerate(places)]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops, priority=len(name) % 3)


def test_reading_never_meets_a_mission_that_changes() -> None:
    """100,000 reads from four threads while commands and plans turn the queue over: none raises.

    Reports are whole: the target is not among what is pending, nothing is visited twice.
    """
    actor = drone_by_hand(AddNavigation(_square("first")), speed=4.0, mission=_HOLD)
    actor.start(host_time_ns())
    done = threading.Event()
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)

    def read() -> int:
        stamps = []
        for _ in range(_READS // 4):
            report = actor.robots()["drone"]
            status = report.mission
            assert status.target not in status.pending
            assert len(set(status.visited)) == len(status.visited)
            stamps.append(status.stamp)
        assert stamps == sorted(stamps)
        return len(set(stamps))

    def command(sender: str) -> int:
        for number in itertools.count():
            if done.is_set():
                return number
            adding = AddNavigation(_square(f"{sender * (1 + number % 3)}{number}"))
            answer = actor.command("drone", adding if number % 4 else ClearNavigation())
            assert answer.accepted, answer.text
            assert not answer.refused
        raise AssertionError

    try:
        with ThreadPoolExecutor(6) as pool:
            commanding = [pool.submit(command, sender) for sender in "ab"]
            seen = [future.result() for future in [pool.submit(read) for _ in range(4)]]
            done.set()
            obeyed = [future.result() for future in commanding]
    finally:
        done.set()
        sys.setswitchinterval(interval)
    assert min(seen) > 1
    assert min(obeyed) > 10
    assert actor.report().error is None
    _land(actor)


def test_what_is_told_while_connecting_has_the_missions_time() -> None:
    """Mission time stands at zero before the start, however long that takes."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=20.0)
    actor.alert("kind", "before")
    actor.start(host_time_ns())
    actor.alert("kind", "after")
    before, after = (one for one in actor.report().alerts if one.kind == "kind")
    assert before.header.stamp == 0
    assert after.header.stamp > 0
    _land(actor)


def test_what_joins_in_flight_has_the_missions_time_before_it_starts() -> None:
    """An actor that is restarted opens its work in the middle of a mission."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=2.0)
    actor.set_origin(host_time_ns() - 30 * NANOSECONDS)
    actor.alert("kind", "while opening")
    (alert,) = (one for one in actor.report().alerts if one.kind == "kind")
    assert alert.header.stamp >= 60 * NANOSECONDS
    actor.stop()


def _until(holds: Callable[[], bool]) -> None:
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_a_drone_whose_application_is_silent_comes_home() -> None:
    """It is told why, and once: a report to the liveness monitor is no word of the application."""
    actor = drone_by_hand(AddNavigation(hop((4, 0), hover=900)), speed=2.0, mission=_HOLD)
    actor.start(host_time_ns())
    end = time.monotonic() + 30.0
    while not (lost := [one for one in actor.report().alerts if one.kind == "application_lost"]):
        assert time.monotonic() < end
        time.sleep(0.1)
    time.sleep(0.2)
    status = actor.robots()["drone"].mission
    assert status.state in {MissionState.RETURNING, MissionState.LANDING}
    assert [one.text for one in lost] == [status.reason]
    _until_over(actor)
    assert actor.robots()["drone"].mission.state is MissionState.LANDED
    actor.stop()


def _until_over(actor: DroneByHand) -> None:
    _until(lambda: actor.report().phase != "running")


def _land(actor: DroneByHand) -> None:
    _until(lambda: actor.robots()["drone"].mission.state not in _ON_GROUND)
    assert actor.command("drone", End()).accepted
    _until_over(actor)
    assert actor.robots()["drone"].mission.state is MissionState.LANDED
    actor.stop()


@pytest.fixture
def vehicle() -> Iterator[type[UnreadableVehicle]]:
    """The class of vehicles that a test can spoil."""
    yield UnreadableVehicle
    UnreadableVehicle.unreadable.clear()
    UnreadableVehicle.landings.clear()


def test_an_actor_whose_loop_fails_leaves_its_vehicle_to_itself(
    vehicle: type[UnreadableVehicle],
) -> None:
    """The vehicle is told to land, and the report names the error."""
    actor = drone_by_hand(
        AddNavigation(hop((2, 0), hover=900)), speed=20.0, driver="drone_nodes:UnreadableVehicle"
    )
    actor.start(host_time_ns())
    _until(lambda: actor.robots()["drone"].mission.state is MissionState.LOITERING)
    vehicle.unreadable.add("drone")
    _until(lambda: actor.report().phase == "failed")
    assert "TypeError" in str(actor.report().error)
    assert vehicle.landings[-1] == "drone"
    actor.stop()


def test_an_actor_flies_on_when_one_of_its_drones_fails(vehicle: type[UnreadableVehicle]) -> None:
    """It ends once the others have landed, as failed, with the error of that drone."""
    names = ("west", "north")
    robots = [
        robot(name, start=[0, 60 * place, 0], sensors=[], driver="drone_nodes:UnreadableVehicle")
        for place, name in enumerate(names)
    ]
    environment = EnvironmentConfig.model_validate(
        {"name": "shared", "robots": robots, "simulation": {"world": "empty"}}
    )
    hover = AddNavigation(hop((2, 0), hover=900))
    specs = tuple(robot_spec(one, hover) for one in environment.robots)
    actor = DroneByHand(Session(environment, 20.0), "drone/west+north", specs)
    actor.open_here()
    actor.start(host_time_ns())
    _until(lambda: all(one.mission.state not in _ON_GROUND for one in actor.robots().values()))
    vehicle.unreadable.add("west")
    _until(lambda: any(one.kind == "drone_failed" for one in actor.report().alerts))
    assert actor.report().phase == "running"
    assert actor.command("north", End()).accepted
    _until(lambda: actor.report().phase == "failed")
    assert actor.robots()["north"].mission.state is MissionState.LANDED
    assert str(actor.report().error).startswith("west: TypeError")
    actor.stop()


def test_a_drone_is_held_by_the_actor_that_brings_it_home(tmp_path: Path) -> None:
    """Where the process of its flight was killed: no other flight begins until it is over."""
    folder = tmp_path / "locks"
    folder.mkdir()
    locks = RobotLocks(folder)
    actor = drone_by_hand(speed=1.0, locks=folder)
    assert locks.held(["drone", "other"]) == {"drone"}
    with pytest.raises(MissionError, match="still flies drone"), locks.hold(["drone"]):
        pass
    with pytest.raises(MissionError, match="still flies drone"):
        drone_by_hand(speed=1.0, locks=folder)
    actor.stop()
    with locks.hold(["drone"]):
        assert locks.held(["drone"]) == {"drone"}

"""From the first word to a vehicle that knows where it is: how long, and where its frame lies."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from autopilot import Family, ScriptedAutopilot
from bench import Bench

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError

HOME = {"latitude": 46.999, "longitude": 8.0, "altitude": 500.0}
"""111.2 m south of where it stands."""


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Bench]:
    """Makes a driver and its autopilot, not connected yet."""

    def made(family: Family = "px4", **settings: Any) -> Bench:  # noqa: ANN401
        return Bench(monkeypatch, ScriptedAutopilot(family), **settings)

    return made


def position(bench: Bench) -> list[float]:
    """Where the driver says that it is, ENU metres."""
    bench.vehicle.connect(5.0)
    bench.turn(0.2)
    found: list[float] = bench.vehicle.read().odometry.position.tolist()
    bench.close()
    return found


def took_off(bench: Bench, north: float, east: float, down: float) -> None:
    """Found in the air, it says where it took off."""
    bench.autopilot.armed, bench.autopilot.mode = True, FlightMode.HOLD
    bench.autopilot.landed = mavlink.MAV_LANDED_STATE_IN_AIR
    home = mavlink.MAVLink_home_position_message(
        1, 2, 3, north, east, down, [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0
    )
    bench.clock.turns.insert(0, lambda _: bench.autopilot.say(home))


def after(bench: Bench, seconds: float, deed: Callable[[], None]) -> None:
    """Something happens so many seconds later."""
    at, done = bench.now + seconds, list[None]()

    def turn(now: float) -> None:
        if now >= at and not done:
            done.append(deed())

    bench.clock.turns.insert(0, turn)


@pytest.mark.parametrize("home", [None, HOME])
@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (4.0, 5.0, 6.0)])
def test_where_it_stands_is_its_start(
    make: Callable[..., Bench], start: tuple[float, float, float], home: dict[str, float] | None
) -> None:
    """Whatever its own frame, and home, say; it is asked for its version."""
    bench = make(start=start, home=home)
    assert position(bench) == pytest.approx(list(start))
    requests = bench.autopilot.of("COMMAND_LONG")
    assert (mavlink.MAV_CMD_REQUEST_MESSAGE, 148.0) in {
        (one.command, one.param1) for one in requests
    }


def test_a_frame_that_is_laid_over_home(make: Callable[..., Bench]) -> None:
    """By its latitude and longitude; the height is the start's."""
    bench = make(frame="home", home=HOME, start=(4.0, 5.0, 6.0))
    assert position(bench) == pytest.approx([0.0, 111.2, 6.0], abs=0.1)


def test_a_vehicle_in_the_air_took_off_from_its_start(make: Callable[..., Bench]) -> None:
    """Its home, by its own word, is the start; over home it is as high as it rose."""
    bench = make(start=(4.0, 5.0, 6.0))
    took_off(bench, 9.0, 18.0, 1.0)
    assert position(bench) == pytest.approx([6.0, 6.0, 10.0])
    bench = make(start=(4.0, 5.0, 6.0), frame="home", home=HOME, fence="return")
    took_off(bench, 9.0, 18.0, 1.0)
    assert position(bench) == pytest.approx([0.0, 111.2, 10.0], abs=0.1)
    kinds = {"PARAM_REQUEST_READ", "PARAM_SET", "MISSION_COUNT"}
    assert not kinds & set(bench.autopilot.kinds()), "neither failsafes nor fences are touched"


def test_who_does_not_say_where_it_took_off_is_not_flown(make: Callable[..., Bench]) -> None:
    """It is given three seconds."""
    bench = make()
    bench.autopilot.armed, bench.autopilot.mode = True, FlightMode.HOLD
    with pytest.raises(VehicleError, match="flying already, and does not say where it took off"):
        bench.vehicle.connect(5.0)
    assert bench.now == pytest.approx(1003.0, abs=0.3)


def test_who_loses_its_place_before_its_frame_lies_is_not_met(make: Callable[..., Bench]) -> None:
    """In the seconds in which it is asked where it took off; afterwards it is."""
    for seconds, lost in ((1.0, True), (3.0, False)):
        bench = make()
        bench.autopilot.armed, bench.autopilot.mode = True, FlightMode.HOLD
        after(bench, 2.0, lambda bench=bench: took_off(bench, 10.0, 20.0, 0.0))
        after(bench, seconds, lambda bench=bench: setattr(bench.autopilot, "globe", (0, 0)))
        if lost:
            with pytest.raises(VehicleError, match="lost its position while being connected"):
                bench.vehicle.connect(5.0)
        else:
            bench.vehicle.connect(5.0)
            bench.close()


@pytest.mark.parametrize("what", ["place", "heartbeat", "position"])
def test_who_does_not_know_its_place_is_waited_for(make: Callable[..., Bench], what: str) -> None:
    """Local, on the globe, and whether it is armed: as long as the settings say, then said."""
    for found in (False, True):
        bench = make("ardupilot", ready_timeout=10.0)
        autopilot = bench.autopilot
        if what == "place":
            autopilot.globe = (0, 0)
            after(bench, 5.0, lambda one=autopilot: setattr(one, "globe", (470000000, 80000000)))
        elif what == "position":
            autopilot.mute = {"LOCAL_POSITION_NED"}
            after(bench, 5.0, lambda one=autopilot: one.mute.clear())
        else:
            # The one by which it was found comes again only later.
            after(bench, 0.1, lambda one=autopilot: one.mute.add("HEARTBEAT"))
            after(bench, 5.0, lambda one=autopilot: one.mute.clear())
        if not found and what != "heartbeat":
            del bench.clock.turns[0]
            words = "ArduPilot has not told its position within 10 s$"
            with pytest.raises(VehicleError, match=words):
                bench.vehicle.connect(5.0)
            assert bench.now == pytest.approx(1010.0, abs=0.3)
        elif found:
            bench.vehicle.connect(5.0)
            bench.close()


def test_the_checks_are_asked_for_while_it_is_waited_for(make: Callable[..., Bench]) -> None:
    """Each four seconds; what it says about them, of the last 40 s, is why it is not ready."""
    bench = make("ardupilot", ready_timeout=50.0)
    bench.autopilot.globe = (0, 0)
    for seconds, text in ((5.0, "too old"), (15.0, "no GPS"), (49.0, "compass")):
        after(bench, seconds, lambda text=text: bench.autopilot.say_text(f"PreArm: {text}", 3))
    with pytest.raises(VehicleError, match=r"50 s; it says: PreArm: no GPS; PreArm: compass$"):
        bench.vehicle.connect(5.0)
    number = mavlink.MAV_CMD_RUN_PREARM_CHECKS
    times = [at for at, one in bench.autopilot.received if getattr(one, "command", 0) == number]
    assert np.diff(times) == pytest.approx([4.05] * 11, abs=0.06)


def test_who_knows_its_place_and_would_not_arm_is_met_in_the_end(
    make: Callable[..., Bench],
) -> None:
    """Sooner if its checks pass; a take-off will be told why they do not."""
    for passing, seconds in ((None, 10.0), (3.0, 3.0)):
        bench = make(ready_timeout=10.0)
        bench.autopilot.checks_pass = False
        if passing is not None:
            after(bench, passing, lambda one=bench: setattr(one.autopilot, "checks_pass", True))
        bench.vehicle.connect(5.0)
        # It waits three seconds more for a version that is not told.
        assert bench.now - 1000.0 == pytest.approx(seconds + 3.0, abs=0.3)
        bench.close()


@pytest.mark.parametrize(
    ("start", "warned"),
    [((0.0, 111.2, 0.0), False), ((19.5, 111.2, 9.0), False), ((-14.4, 125.6, 0.0), True)],
)
def test_a_start_far_from_where_it_stands_is_warned_of(
    make: Callable[..., Bench],
    caplog: pytest.LogCaptureFixture,
    start: tuple[float, float, float],
    *,
    warned: bool,
) -> None:
    """20 m along the ground by the globe; not one in the air, which has flown away from there."""
    position(make(home=HOME, start=start))
    assert ("global waypoints would lead astray" in caplog.text) is warned
    caplog.clear()
    bench = make(home=HOME, start=start)
    took_off(bench, 10.0, 20.0, -3.0)
    position(bench)
    assert "lead astray" not in caplog.text

"""A pilot, or the autopilot's own protection, takes over unheard: nobody overrides."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from stepped import Stepped
from stepped_missions import started

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.mission.loop import SetpointLoop
from aerodaas.types.status import MissionState as S
from aerodaas.types.vehicle import VehicleMode
from aerodaas.types.waypoints import Waypoint
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.firmware import Firmware

FAMILIES = ["ardupilot", "px4"]
ORDERS = {
    mavlink.MAV_CMD_DO_SET_MODE,
    mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
    mavlink.MAV_CMD_NAV_TAKEOFF,
}
PILOT = {
    "ardupilot": {
        "land": (9,),
        "return": (6,),
        "loiter": (5,),
        "altitude hold": (2,),
        "brake": (17,),
    },
    "px4": {"land": (4, 6), "return": (4, 5), "hold": (4, 3), "position": (3, 0)},
}
"""Modes that a pilot chooses, as parameters of DO_SET_MODE."""
EVERY = [(family, name) for family, modes in PILOT.items() for name in modes]


class Flown:
    """A mission to a far place on an emulated autopilot, turn by turn."""

    def __init__(self, ends: Stepped, height: float) -> None:
        self.ends = ends
        self.loop: SetpointLoop = started(ends, [Waypoint("far", 0, 60, height)])
        self.modes: list[VehicleMode] = []

    @property
    def firmware(self) -> Firmware:
        """The autopilot."""
        return self.ends.autopilot.firmware

    def run(self, seconds: float) -> None:
        """Turn the loop."""
        end = self.ends.now + seconds
        while self.ends.now < end:
            self.ends.advance(0.05)
            self.loop.turn(round(self.ends.now * 1e9))
            assert self.loop.state is not None
            self.modes.append(self.loop.state.mode)

    def until(self, state: S, seconds: float = 60.0) -> None:
        """Turn the loop until the mission is in this state."""
        end = self.ends.now + seconds
        while self.loop.mission.state is not state:
            assert self.ends.now < end, self.story
            self.run(0.05)

    def choose(self, name: str) -> int:
        """A pilot chooses a mode; returns it as HEARTBEATs show it."""
        family = self.ends.autopilot.options.family
        values = (1.0, *map(float, PILOT[family][name]), *[0.0] * 6)[:7]
        self.firmware.obey(mavlink.MAV_CMD_DO_SET_MODE, values, None)
        return self.firmware.custom_mode

    def orders(self) -> list[Any]:
        """Orders of modes, motors and take-off that the autopilot has heard."""
        return [
            message
            for _, message in self.ends.autopilot.heard
            if getattr(message, "command", None) in ORDERS
        ]

    @property
    def story(self) -> str:
        """For a failed assertion."""
        mission = self.loop.mission
        alerts = [alert.text for alert in mission.alerts]
        modes = [
            one for one, two in zip(self.modes, [None, *self.modes], strict=False) if one is not two
        ]
        return f"{mission.state} {mission.status.reason!r} {alerts} {modes}"


@contextmanager
def flown(
    monkeypatch: pytest.MonkeyPatch,
    family: str,
    height: float = 3.0,
    **parameters: float,
) -> Iterator[Flown]:
    """A mission that is about to take off to `height` metres."""
    own = {"COM_OBL_RC_ACT": 5.0} if family == "px4" else {}
    options = AutopilotOptions(family=family, parameters={**own, **parameters})  # type: ignore[arg-type]
    with Stepped(monkeypatch, options, limits={"takeoff_height": height}) as ends:
        yield Flown(ends, height)


@pytest.mark.parametrize("silence", [2.0, 6.0])
@pytest.mark.parametrize(("family", "name"), EVERY)
def test_who_takes_over_in_a_silence_keeps_it(
    monkeypatch: pytest.MonkeyPatch, family: str, name: str, silence: float
) -> None:
    """Not one order after the link's return; the mission is over within moments."""
    with flown(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.run(2.0)
        flight.ends.autopilot.cut()
        flight.run(silence / 2)
        chosen = flight.choose(name)
        flight.run(silence / 2)
        before = len(flight.orders())
        flight.ends.autopilot.cut(off=False)
        flight.run(4.0)
        assert len(flight.orders()) == before, flight.story
        assert flight.firmware.custom_mode == chosen, flight.story
        assert flight.loop.mission.state is S.ABORTED, flight.story
        assert flight.loop.mission.status.reason.endswith("has taken over")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_landing_of_its_pilots_is_left_alone_to_the_ground(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """It stands by the time that the link is back, in a mode of the pilot's: it stays so."""
    with flown(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.run(2.0)
        flight.choose("land")
        while flight.firmware.armed:
            flight.run(0.5)
        chosen = flight.choose("return")
        flight.run(2.0)
        before = len(flight.orders())
        flight.ends.autopilot.cut(off=False)
        flight.run(4.0)
        assert len(flight.orders()) == before, flight.story
        assert flight.firmware.custom_mode == chosen
        assert flight.loop.mission.finished, flight.story


@pytest.mark.parametrize("family", FAMILIES)
def test_its_own_return_in_a_silence_goes_on(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Nobody turns it back into a return of ours, which would fly by setpoints."""
    with flown(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.run(4.0)
        flight.ends.autopilot.protect_itself()
        flight.run(2.0)
        before, chosen = len(flight.orders()), flight.firmware.custom_mode
        flight.ends.autopilot.cut(off=False)
        flight.run(3.0)
        assert len(flight.orders()) == before, flight.story
        assert flight.firmware.custom_mode == chosen
        assert flight.loop.mission.status.reason.startswith("the vehicle's own protection")


@pytest.mark.parametrize("silence", [1.7, 6.0])
def test_who_was_left_alone_is_flown_on_after_a_silence(
    monkeypatch: pytest.MonkeyPatch, silence: float
) -> None:
    """In the mode in which we left it, once a HEARTBEAT has shown that; LOST until then."""
    with flown(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        flight.run(4.0)
        flight.ends.autopilot.cut()
        flight.run(silence)
        assert flight.modes[-1] is VehicleMode.LOST
        beats = flight.ends.vehicle.telemetry.beat_at
        flight.ends.autopilot.cut(off=False)
        flight.run(0.05)
        while flight.ends.vehicle.telemetry.beat_at == beats:
            assert flight.modes[-1] is VehicleMode.LOST
            flight.run(0.05)
        flight.run(1.0)
        assert flight.modes[-1] is VehicleMode.GUIDED
        assert flight.loop.mission.state is (S.ENROUTE if silence < 3.0 else S.RETURNING)
        flight.until(S.LANDED, 120.0)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_order_goes_out_into_a_silence(monkeypatch: pytest.MonkeyPatch, family: str) -> None:
    """Whatever is asked of the driver."""
    with flown(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        autopilot = flight.ends.autopilot
        autopilot.cut()
        autopilot.spoil(up=type(autopilot.options.uplink)())
        flight.run(1.0)
        before = len(flight.orders())
        vehicle = flight.ends.vehicle
        for deed in (vehicle.hold, vehicle.return_home, vehicle.land):
            deed()
            flight.ends.advance(2.5)
            vehicle.read()
        assert len(flight.orders()) == before


@pytest.mark.parametrize(("family", "name"), EVERY)
def test_who_takes_over_during_a_take_off_keeps_it(
    monkeypatch: pytest.MonkeyPatch, family: str, name: str
) -> None:
    """Half way up: no order follows, and the mission is over within moments."""
    with flown(monkeypatch, family, height=10.0) as flight:
        flight.until(S.TAKING_OFF)
        while flight.ends.autopilot.truth.position[2] < 5.0:
            flight.run(0.1)
        chosen, before = flight.choose(name), len(flight.orders())
        flight.run(4.0)
        assert len(flight.orders()) == before, flight.story
        assert flight.firmware.custom_mode == chosen
        assert flight.loop.mission.status.reason == "a pilot has taken over"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_pilot_before_the_motors_turn_ends_the_take_off(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """The autopilot will not arm yet; meanwhile somebody chooses another mode: nothing is armed."""
    with flown(monkeypatch, family) as flight:
        monkeypatch.setattr(flight.firmware, "may_arm", lambda: False)
        flight.until(S.TAKING_OFF)
        flight.run(2.0)
        flight.choose("land")
        flight.run(1.5)
        before = len(flight.orders())
        monkeypatch.setattr(flight.firmware, "may_arm", lambda: True)
        flight.run(10.0)
        assert len(flight.orders()) == before, flight.story
        assert not flight.firmware.armed
        assert flight.loop.mission.state is S.ABORTED, flight.story


def test_letting_go_in_a_silence_orders_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Though the vehicle would hear it: whose it is by now is not known."""
    with flown(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        autopilot = flight.ends.autopilot
        autopilot.cut()
        autopilot.spoil(up=type(autopilot.options.uplink)())
        flight.run(2.0)
        before = len(flight.orders())
        flight.ends.vehicle.close()
        assert len(flight.orders()) == before


def test_a_loop_that_hangs_in_a_silence_is_answered_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is told to hold once a HEARTBEAT has shown that it is still ours."""
    with flown(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.ends.advance(3.0)
        before = len(flight.orders())
        flight.ends.autopilot.cut(off=False)
        flight.ends.advance(1.5)
        (order,) = flight.orders()[before:]
        assert (order.command, order.param2) == (mavlink.MAV_CMD_DO_SET_MODE, 17.0)

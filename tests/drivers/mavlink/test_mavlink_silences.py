"""A pilot, or the autopilot's own protection, takes over, heard or not: nobody overrides."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from autopilot import ARM, COMMANDS, MODE, RISE, SETPOINT, Family
from emulated import FAMILIES, FlownMission, Stepped

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import Waypoint
from aerodaas.testing.channel import Impairment
from tools.mavlink_vehicle import AutopilotOptions

PILOT: dict[str, dict[str, tuple[float, ...]]] = {
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


@contextmanager
def mission(
    monkeypatch: pytest.MonkeyPatch, family: Family, height: float = 3.0, **parameters: float
) -> Iterator[FlownMission]:
    """A mission to a far place, about to take off to `height` metres."""
    own = {"COM_OBL_RC_ACT": 5.0} if family == "px4" else {}
    options = AutopilotOptions(family=family, parameters={**own, **parameters})
    with Stepped(monkeypatch, options, limits={"takeoff_height": height}) as ends:
        yield ends.mission([Waypoint("far", 0, 60, height)])


def choose(flight: FlownMission, name: str) -> int:
    """A pilot chooses a mode; returns it as HEARTBEATs show it."""
    firmware = flight.ends.firmware
    values = (1.0, *PILOT[flight.ends.autopilot.options.family][name], *[0.0] * 6)[:7]
    firmware.obey(MODE, values, None)
    return firmware.custom_mode


def orders(flight: FlownMission) -> list[Any]:
    """Commands of modes, motors and take-off that the autopilot has received."""
    return [one for one in flight.ends.heard(*COMMANDS) if one.command in {MODE, ARM, RISE}]


@pytest.mark.parametrize(
    ("family", "name", "silence"),
    [*((*one, 6.0) for one in EVERY), ("px4", "position", 2.0), ("ardupilot", "brake", 2.0)],
)
def test_who_takes_over_in_a_silence_keeps_it(
    monkeypatch: pytest.MonkeyPatch, family: Family, name: str, silence: float
) -> None:
    """Not one order after the link's return; the mission is over within moments."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.run(2.0)
        flight.ends.autopilot.cut()
        flight.run(silence / 2)
        chosen = choose(flight, name)
        flight.run(silence / 2)
        before = len(orders(flight))
        flight.ends.autopilot.cut(off=False)
        flight.run(4.0)
        assert len(orders(flight)) == before, flight.story
        assert flight.ends.firmware.custom_mode == chosen, flight.story
        assert flight.mission.state is S.ABORTED, flight.story
        assert flight.mission.status.reason.endswith("has taken over")


@pytest.mark.parametrize("family", FAMILIES)
def test_a_landing_of_its_pilots_is_left_alone_to_the_ground(
    monkeypatch: pytest.MonkeyPatch, family: Family
) -> None:
    """It stands by the time that the link is back, in a mode of the pilot's: it stays so."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.run(2.0)
        choose(flight, "land")
        flight.until(lambda: not flight.ends.firmware.armed)
        chosen = choose(flight, "return")
        flight.run(2.0)
        before = len(orders(flight))
        flight.ends.autopilot.cut(off=False)
        flight.run(4.0)
        assert len(orders(flight)) == before, flight.story
        assert flight.ends.firmware.custom_mode == chosen
        assert flight.mission.finished, flight.story


@pytest.mark.parametrize("family", FAMILIES)
def test_its_own_return_in_a_silence_goes_on(
    monkeypatch: pytest.MonkeyPatch, family: Family
) -> None:
    """Nobody turns it back into a return of ours, which would fly by setpoints."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.run(4.0)
        flight.ends.autopilot.protect_itself()
        flight.run(2.0)
        before, chosen = len(orders(flight)), flight.ends.firmware.custom_mode
        flight.ends.autopilot.cut(off=False)
        flight.run(3.0)
        assert len(orders(flight)) == before, flight.story
        assert flight.ends.firmware.custom_mode == chosen
        assert flight.mission.status.reason.startswith("the vehicle's own protection")


@pytest.mark.parametrize("silence", [1.7, 6.0])
def test_who_was_left_alone_is_flown_on_after_a_silence(
    monkeypatch: pytest.MonkeyPatch, silence: float
) -> None:
    """In the mode in which we left it, once a HEARTBEAT has shown that; LOST until then."""
    with mission(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        flight.run(4.0)
        flight.ends.autopilot.cut()
        flight.run(silence)
        assert flight.modes[-1] is VehicleMode.LOST
        telemetry = flight.ends.vehicle.telemetry
        beats = telemetry.beat_at
        flight.ends.autopilot.cut(off=False)
        flight.turn()
        while telemetry.beat_at == beats:
            assert flight.modes[-1] is VehicleMode.LOST
            flight.turn()
        flight.run(1.0)
        assert flight.modes[-1] is VehicleMode.GUIDED
        assert flight.mission.state is (S.ENROUTE if silence < 3.0 else S.RETURNING)
        flight.until(S.LANDED)


@pytest.mark.parametrize("family", FAMILIES)
def test_no_order_goes_out_into_a_silence(monkeypatch: pytest.MonkeyPatch, family: Family) -> None:
    """Though the vehicle would hear it: whose it is by now is not known, nor as we let go of it."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.ends.autopilot.spoil(up=Impairment())
        flight.run(1.0)
        before, vehicle = len(orders(flight)), flight.ends.vehicle
        for deed in (vehicle.hold, vehicle.return_home, vehicle.land):
            deed()
            flight.ends.advance(2.5)
            vehicle.read()
        vehicle.close()
        assert len(orders(flight)) == before


@pytest.mark.parametrize(
    ("family", "name"),
    [("ardupilot", "land"), ("ardupilot", "loiter"), ("px4", "return"), ("px4", "position")],
)
def test_who_takes_over_during_a_take_off_keeps_it(
    monkeypatch: pytest.MonkeyPatch, family: Family, name: str
) -> None:
    """Half way up: no order follows, and the mission is over within moments."""
    with mission(monkeypatch, family, height=10.0) as flight:
        flight.until(lambda: flight.ends.autopilot.truth.position[2] > 5.0)
        chosen, before = choose(flight, name), len(orders(flight))
        flight.run(4.0)
        assert len(orders(flight)) == before, flight.story
        assert flight.ends.firmware.custom_mode == chosen
        assert flight.mission.status.reason == "a pilot has taken over"


@pytest.mark.parametrize("family", FAMILIES)
def test_a_pilot_before_the_motors_turn_ends_the_take_off(
    monkeypatch: pytest.MonkeyPatch, family: Family
) -> None:
    """The autopilot will not arm yet; meanwhile somebody chooses another mode: nothing is armed."""
    with mission(monkeypatch, family) as flight:
        monkeypatch.setattr(flight.ends.firmware, "may_arm", lambda: False)
        flight.until(S.TAKING_OFF)
        flight.run(2.0)
        choose(flight, "land")
        flight.run(1.5)
        before = len(orders(flight))
        monkeypatch.setattr(flight.ends.firmware, "may_arm", lambda: True)
        flight.run(10.0)
        assert len(orders(flight)) == before, flight.story
        assert not flight.ends.firmware.armed
        assert flight.mission.state is S.ABORTED, flight.story


def test_a_loop_that_hangs_in_a_silence_is_answered_after_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is told to hold once a HEARTBEAT has shown that it is still ours."""
    with mission(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        flight.ends.autopilot.cut()
        flight.ends.advance(3.0)
        before = len(orders(flight))
        flight.ends.autopilot.cut(off=False)
        flight.ends.advance(1.5)
        (order,) = orders(flight)[before:]
        assert (order.command, order.param2) == (MODE, 17.0)


@pytest.mark.parametrize(
    ("family", "acts", "said", "why"),
    [
        ("ardupilot", "breach", "", "its own geofence: outside"),
        ("ardupilot", "enter_return", "Battery Failsafe", "Battery Failsafe"),
        ("px4", "breach", "", "its own geofence: outside"),
    ],
)
def test_why_its_own_protection_has_taken_over_is_told(
    monkeypatch: pytest.MonkeyPatch,
    family: Family,
    acts: str,
    said: str,
    why: str,
) -> None:
    """The reason comes a second after the mode; it is in the mission's, and no pilot is named."""
    parameters = {"FENCE_ENABLE": 1.0} if family == "ardupilot" else {"GF_ACTION": 3.0}
    with mission(monkeypatch, family, **parameters) as flight:
        flight.until(S.ENROUTE)
        flight.run(3.0)
        getattr(flight.ends.firmware, acts)()
        flight.run(1.2)
        if said:
            flight.ends.firmware.text(said, mavlink.MAV_SEVERITY_WARNING)
        flight.run(6.0)
        reason = flight.mission.status.reason
        assert flight.mission.state is S.ABORTED
        assert "own protection" in reason
        assert why in reason
        assert flight.told("pilot", "failsafe") == [reason]


def test_a_pilot_within_his_own_fence_is_a_pilot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing else explains the mode; no order is sent from the first moment on."""
    with mission(monkeypatch, "ardupilot") as flight:
        flight.until(S.ENROUTE)
        flight.run(3.0)
        flight.ends.autopilot.take_over()
        flight.run(1.5)
        before = len(flight.ends.heard(SETPOINT, *COMMANDS))
        flight.run(6.0)
        assert flight.mission.status.reason == "a pilot has taken over"
        assert len(flight.ends.heard(SETPOINT, *COMMANDS)) == before


@pytest.mark.parametrize(("family", "duration"), [("px4", 8.0), ("ardupilot", 2.0)])
def test_of_a_link_that_is_cut_only_the_link_is_named(
    monkeypatch: pytest.MonkeyPatch, family: Family, duration: float
) -> None:
    """Neither the position nor the GPS, of which nothing can be heard, and each thing once."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.run(3.0)
        before = len(flight.told())
        flight.ends.autopilot.cut()
        flight.run(duration)
        flight.ends.autopilot.cut(off=False)
        flight.run(0.3)
        told = flight.told()[before:]
        assert told[0] == "no word from the vehicle"
        assert not any("position" in text or "GPS" in text for text in told)
        assert told.count("no word from the vehicle") == 1


@pytest.mark.parametrize("family", FAMILIES)
def test_silence_after_a_restart_is_silence(
    monkeypatch: pytest.MonkeyPatch, family: Family
) -> None:
    """An autopilot that started anew and falls silent before it has said where it is: lost."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.run(6.0)
        flight.ends.autopilot.restart()
        flight.until(lambda: flight.ends.vehicle.telemetry.reboots)
        flight.ends.autopilot.cut()
        flight.run(3.0)
        state = flight.ends.vehicle.read()
        assert state.mode is VehicleMode.LOST
        assert not np.isfinite(state.odometry.position).any()


@pytest.mark.parametrize(
    ("family", "duration"), [("px4", 0.1), ("px4", 2.0), ("ardupilot", 0.3), ("ardupilot", 0.6)]
)
def test_a_landing_that_nobody_heard_did_not_fall(
    monkeypatch: pytest.MonkeyPatch, family: Family, duration: float
) -> None:
    """Landed by its own protection while the link was cut: it is neither thought nor told."""
    with mission(monkeypatch, family) as flight:
        flight.until(S.ENROUTE)
        flight.run(1.0)
        flight.ends.autopilot.cut()
        flight.run(4.0)
        flight.ends.autopilot.protect_itself()
        flight.until(lambda: not flight.ends.autopilot.armed)
        flight.run(duration)
        flight.ends.autopilot.cut(off=False)
        flight.run(6.0)
        assert flight.mission.state is S.LANDED, flight.story
        assert flight.mission.status.reason.startswith("no word from the vehicle for")
        assert not any("motors" in text for text in flight.told())

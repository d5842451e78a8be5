"""Flights on real PX4 and ArduCopter in which something breaks: what it does, what people hear.

Each prints the simulator's own truth and every alert; docs/benchmarks.md keeps the table of them.
"""

from __future__ import annotations

import math
import time

import pytest
from required import needs_peer

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.messages.mission import MissionState as S
from aerodaas.mission.commands import End
from aerodaas.testing.channel import Impairment
from sitl.autopilot import Autopilot
from sitl.flights import FAR, FARM, SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420)]

FORCED = 21196.0
"""The magic number by which MAV_CMD_COMPONENT_ARM_DISARM stops the motors in the air, too."""
LOWEST = 0.05
"""Charge at which it lands where it is, unless a battery breaks down."""
FEW = 6
"""Alerts that one fault may make."""


def alerts(flight: SitlFlight) -> list[str]:
    """What people were told."""
    return [alert.text for alert in flight.mission.alerts]


def expect_motors_stopped(flight: SitlFlight) -> None:
    """It is over at once, for the right reason and with few words."""
    assert flight.mission.state is S.ABORTED, flight.story
    assert "motors stopped in flight at E" in flight.status.reason
    assert sum("motors stopped" in text for text in alerts(flight)) == 1
    assert len(alerts(flight)) <= FEW, alerts(flight)


def test_kill_switch(autopilot: Autopilot) -> None:
    """Motors stopped in the air by a switch: aborted within three seconds, told once."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(6.0)
        flight.command_as_station(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, FORCED)
        flight.run(3.0)
        expect_motors_stopped(flight)
        time.sleep(5.0)
        flight.tell_outcome("kill switch")
        assert not flight.relay.witness.armed


def test_restart_in_flight(autopilot: Autopilot) -> None:
    """The autopilot loses power in flight and comes back: aborted, and nobody takes off again."""
    if not autopilot.restarts:
        pytest.skip("the environment does not say how to start this autopilot")
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(6.0)
        autopilot.stop()
        flight.run(1.0)
        autopilot.start()
        flight.run(60.0)
        time.sleep(10.0)
        flight.tell_outcome("autopilot restarted in flight")
        expect_motors_stopped(flight)
        assert flight.relay.witness.armings == 1


@pytest.mark.parametrize("after", [0.1, 0.3, 0.6, 1.0])
def test_abort_in_the_first_second(autopilot: Autopilot, after: float) -> None:
    """Once the mission says that it is over the motors stand, and stay so."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.TAKING_OFF)
        flight.run(after)
        flight.tell(End("the user said so"))
        flight.run(60.0)
        ended = time.monotonic()
        witness = flight.relay.witness
        armed, armings = witness.armed, witness.armings
        turned = False
        while time.monotonic() - ended < 15.0:
            turned |= witness.armed
            time.sleep(0.05)
        flight.tell_outcome(f"abort {after:g} s into take-off")
        assert flight.mission.finished, flight.story
        assert not armed
        assert not turned
        assert witness.armings == armings


@pytest.mark.parametrize("boot", [0.3])
def test_take_off_straight_after_boot(autopilot: Autopilot) -> None:
    """The mission waits until it would arm, and flies."""
    if not autopilot.restarts:
        pytest.skip("the environment does not say how to start this autopilot")
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run(180.0)
        flight.tell_outcome("take-off straight after boot")
        assert flight.mission.state is S.LANDED, flight.story
        assert flight.status.visited == ("wp1",)


def test_gps_lost(autopilot: Autopilot) -> None:
    """People are told that it is GPS, before it comes down."""
    with SitlFlight(autopilot.url, FAR) as flight:
        flight.run_to(S.ENROUTE)
        flight.run(6.0)
        flight.set_parameter(*(("SIM_GPS_USED", 0.0) if flight.px4 else ("SIM_GPS1_ENABLE", 0.0)))
        flight.run(120.0)
        flight.wait_for_ground()
        flight.tell_outcome("GPS lost")
        assert flight.mission.finished, flight.story
        assert any("GPS" in text for text in alerts(flight)), alerts(flight)
        assert len(alerts(flight)) <= 2 * FEW, alerts(flight)


@pytest.mark.parametrize(
    "autopilot",
    [pytest.param("ardupilot", marks=needs_peer("AERODAAS_SITL_ARDUPILOT"))],
    indirect=True,
)
def test_wind(autopilot: Autopilot) -> None:
    """8 m/s from the north-west: the survey is flown, and it comes home.

    The simulator of PX4 that is flown here knows no wind.
    """
    with SitlFlight(autopilot.url, FARM) as flight:
        flight.set_parameter("SIM_WIND_DIR", 315.0)
        flight.set_parameter("SIM_WIND_SPD", 8.0)
        flight.run(240.0)
        flight.tell_outcome("wind of 8 m/s")
        assert flight.mission.state is S.LANDED, flight.story
        assert len(flight.status.visited) == 4
        assert flight.relay.witness.away < 2.0


@pytest.mark.parametrize(("low", "critical"), [(0.8, 0.05), (0.7, 0.5)])
def test_battery(autopilot: Autopilot, low: float, critical: float) -> None:
    """Low, it comes home; a battery that breaks down while it does has it land where it is."""
    if autopilot.family == "px4":
        drain = {"SIM_BAT_DRAIN": 120.0, "SIM_BAT_MIN_PCT": 5.0}
        breakdown = ("SIM_BAT_DRAIN", 10.0)
    else:
        drain = {"BATT_CAPACITY": 500.0}
        breakdown = ("BATT_CAPACITY", 150.0)
    with SitlFlight(
        autopilot.url, FAR, battery_return=low, battery_land=critical, cruise_speed=1.0
    ) as flight:
        for name, value in drain.items():
            flight.set_parameter(name, value)
        if critical > LOWEST:
            flight.run_to(S.RETURNING)
            flight.run(2.0)
            flight.set_parameter(*breakdown)
        flight.run(240.0)
        flight.wait_for_ground()
        flight.tell_outcome(f"battery: return at {low:.0%}, land at {critical:.0%}")
        assert flight.mission.state is S.LANDED, flight.story
        assert S.RETURNING in flight.states
        assert any("battery" in text for text in alerts(flight)), alerts(flight)
        away = flight.relay.witness.away
        assert away > 4.0 if critical > LOWEST else away < 2.0


@pytest.mark.parametrize("seed", range(10))
def test_bad_link(autopilot: Autopilot, seed: int) -> None:
    """A fifth of all packets lost and a tenth of a second of delay, both ways, from the start."""
    del seed
    link = Impairment(loss=0.2, delay=0.1)
    with SitlFlight(autopilot.url, FARM, link=link) as flight:
        flight.run(240.0)
        flight.tell_outcome("20 % loss, 100 ms delay")
        assert flight.mission.state is S.LANDED, flight.story
        assert len(flight.status.visited) == 4
        assert not math.isnan(flight.relay.witness.away)
        assert flight.relay.witness.away < 2.0

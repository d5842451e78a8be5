"""A gripper, a servo and a relay of a real autopilot in simulation, moved at waypoints.

It needs one that has them: for ArduCopter the parameters of `actuators.parm`. PX4 moves a gripper,
and no servo or relay by a command. Where the autopilot refuses the gripper on the ground, the tests
are skipped.
"""

from __future__ import annotations

import pytest
from required import needs_peer

from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import Actuate, AddNavigation
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

CARRIED: list[ActuatorConfig] = [
    GripperConfig(id="hook", type="gripper"),
    RelayConfig(id="pump", type="relay"),
    ServoConfig(id="hatch", type="servo", channel=14, positions={"open": 1900, "closed": 1100}),
    ServoConfig(id="motor", type="servo", channel=1, positions={"full": 2000}),
]
STOPS = AddNavigation(
    AeroNavigation(
        data=[
            Waypoint("drop", 0, 5, 3, actuate={"hatch": "open", "hook": "release", "pump": "on"}),
            Waypoint("away", 5, 5, 3, actuate={"hatch": "closed", "pump": "off"}),
            Waypoint("wrong", 5, 0, 3, actuate={"motor": "full", "hatch": "open"}),
        ]
    )
)


def deliver(flight: SitlFlight) -> tuple[list[str], list[dict[str, str]]]:
    """Fly to the mission's end; what people were told of the actuators, and how these moved."""
    assert flight.tell(Actuate("hook", "grab")).accepted
    flight.run(60.0, lambda: flight.mission.state is S.ENROUTE)
    if flight.vehicle.read().actuators.get("hook") != "grab":
        pytest.skip("this autopilot has no gripper")
    moved: list[dict[str, str]] = []

    def look() -> bool:
        state = flight.vehicle.read().actuators
        if not moved or moved[-1] != state:
            moved.append(dict(state))
        return False

    flight.run(180.0, look)
    assert flight.mission.state is S.LANDED, flight.story
    flight.tell_outcome("a delivery")
    return [one.text for one in flight.mission.alerts if one.kind == "actuator"], moved


@pytest.mark.parametrize(
    "autopilot",
    [pytest.param("ardupilot", marks=needs_peer("AERODAAS_SITL_ARDUPILOT"))],
    indirect=True,
)
def test_a_delivery(autopilot: Autopilot) -> None:
    """Each position is taken where it is to be; an output that turns a motor is refused."""
    with SitlFlight(autopilot.url, STOPS, actuators=CARRIED) as flight:
        alerts, moved = deliver(flight)
        assert alerts == ["wrong: motor: full: not done: failed; nor hatch"]
        assert moved == [
            {"hook": "grab"},
            {"hook": "grab", "hatch": "open"},
            {"hook": "release", "hatch": "open"},
            {"hook": "release", "hatch": "open", "pump": "on"},
            {"hook": "release", "hatch": "closed", "pump": "on"},
            {"hook": "release", "hatch": "closed", "pump": "off"},
        ]


@pytest.mark.parametrize(
    "autopilot", [pytest.param("px4", marks=needs_peer("AERODAAS_SITL_PX4"))], indirect=True
)
def test_a_delivery_by_a_gripper_alone(autopilot: Autopilot) -> None:
    """The gripper lets go where it is to; the servo is refused, which is told and flown on from."""
    stops = [
        Waypoint("drop", 0, 5, 3, actuate={"hook": "release"}),
        Waypoint("away", 5, 5, 3, actuate={"hatch": "open", "pump": "on"}),
    ]
    order = AddNavigation(AeroNavigation(data=stops))
    with SitlFlight(autopilot.url, order, actuators=CARRIED) as flight:
        alerts, moved = deliver(flight)
        assert alerts == ["away: hatch: open: not done: not supported; nor pump"]
        assert moved == [{"hook": "grab"}, {"hook": "release"}]
        assert flight.status.visited == ("drop", "away")

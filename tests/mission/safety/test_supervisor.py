"""What the drone's condition demands, at the very edge of each rule."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from grounds import clearance

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.geometry.energy import EnergyMeter, EnergyModel
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.mission.motion_requests import Fly
from aerodaas.mission.safety.failsafe import FailsafeAction, Fault
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.supervisor import CALM, Assessment, Supervisor

LIMITS = LimitsConfig(battery_return=0.25, battery_land=0.125, link_timeout=3.0)
FENCE = GeofenceConfig(polygon=[(-50, -50), (50, -50), (50, 50), (-50, 50)])


def supervisor(limits: LimitsConfig = LIMITS) -> Supervisor:
    """One that watches a drone which took off at the origin."""
    meter = EnergyMeter(EnergyModel(limits.endurance, np.zeros(3)))
    return Supervisor(limits, np.zeros(3), Geofence(FENCE), meter)


def state(
    charge: float = 1.0,
    *,
    at: tuple[float, float, float] = (0.0, 0.0, 5.0),
    stamp: float = 0.0,
    mode: VehicleMode = VehicleMode.GUIDED,
    faults: tuple[str, ...] = (),
) -> VehicleState:
    """A vehicle in the air, read at `stamp` seconds."""
    odometry = Odometry(np.array(at), np.zeros(3), 0.0)
    when = round(stamp * NANOSECONDS)
    return VehicleState(when, odometry, Battery(charge), mode, armed=True, faults=faults)


@pytest.mark.parametrize(
    ("charge", "demand", "kind"),
    [
        (0.2501, FailsafeAction.NOTHING, ""),
        (0.25, FailsafeAction.RETURN, "battery_low"),
        (0.1251, FailsafeAction.RETURN, "battery_low"),
        (0.125, FailsafeAction.LAND, "battery_critical"),
        (0.0, FailsafeAction.LAND, "battery_critical"),
        (math.nan, FailsafeAction.NOTHING, "battery_unknown"),
    ],
)
def test_a_battery_at_its_limit_is_beyond_it(
    charge: float, demand: FailsafeAction, kind: str
) -> None:
    """At 25 % the drone returns, at 12.5 % it lands; a gauge that says nothing is told of."""
    found = supervisor().assess(state(charge), 0)
    assert (found.action, found.gravest.kind) == (demand, kind)
    word = {"battery_low": "low", "battery_critical": "critical"}.get(kind)
    assert word is None or found.gravest.text == f"the battery is {word} at {charge:.0%}"


def test_the_way_home_is_kept_in_the_battery() -> None:
    """40 m off, the drone turns back while the way home and the reserve are left, to the dot."""
    limits = replace_limits(battery_return=0.0, battery_land=0.0)
    meter = EnergyMeter(EnergyModel(limits.endurance, np.zeros(3)))
    where = np.array([40.0, 0.0, 5.0])
    needed = meter.way_home(where, np.zeros(3), limits.cruise_speed)
    assert 0.0 < needed < 0.2
    for charge, demand in (
        (needed, FailsafeAction.RETURN),
        (needed * 1.001, FailsafeAction.NOTHING),
    ):
        found = supervisor(limits).assess(state(charge, at=(40.0, 0.0, 5.0)), 0)
        assert found.action is demand
        text = f"the way home needs {needed:.0%} of the battery's {charge:.0%}"
        assert found.gravest.text == (text if demand is FailsafeAction.RETURN else "")
    reserve = replace_limits(battery_return=0.1, battery_land=0.1)
    for charge, demand in (
        (needed + 0.1, FailsafeAction.RETURN),
        (needed + 0.1001, FailsafeAction.NOTHING),
    ):
        found = supervisor(reserve).assess(state(charge, at=(40.0, 0.0, 5.0)), 0)
        assert found.action is demand


def replace_limits(**more: float) -> LimitsConfig:
    """The limits of these tests with others instead."""
    return LIMITS.model_copy(update=more)


def test_a_vehicle_is_lost_for_good_at_its_time_out() -> None:
    """To the nanosecond, and not before."""
    watching = supervisor()
    watching.assess(state(mode=VehicleMode.LOST), 0)
    timeout = round(LIMITS.return_timeout * NANOSECONDS)
    assert watching.lost_for_good(timeout - 1) == ""
    assert "lost" in watching.lost_for_good(timeout)


def test_a_drone_that_stands_on_a_hill_is_landed() -> None:
    """Its height is counted from the ground below it, and not from where it took off."""
    for hill, demand in ((8.0, FailsafeAction.LAND), (0.0, FailsafeAction.NOTHING)):
        meter = EnergyMeter(EnergyModel(LIMITS.endurance, np.zeros(3)))
        above = clearance(lambda east, _, hill=hill: np.where(east > 10.0, hill, 0.0), LIMITS, 0.1)
        watching = Supervisor(LIMITS, np.zeros(3), Geofence(FENCE), meter, above)
        setpoint = VelocitySetpoint(np.array([2.0, 0.0, 0.0]))
        watching.motion.command(Fly(setpoint), setpoint)
        found = CALM
        for second in range(12):
            told = state(at=(30.0, 0.0, 8.4), stamp=float(second))
            found = watching.assess(told, second * NANOSECONDS)
        assert found.action is demand


@pytest.mark.parametrize("lost", ["mode", "stamp"])
def test_a_link_that_is_lost_for_its_time_out_sends_the_drone_home(lost: str) -> None:
    """Of 3 s: standing still before, at 3 s exactly on the way home, whatever shows the loss."""
    watching = supervisor()
    began = 5 * NANOSECONDS
    silent = state(mode=VehicleMode.LOST, stamp=5.0) if lost == "mode" else state(stamp=3.9)
    for after, demand in (
        (0, FailsafeAction.HOLD),
        (3 * NANOSECONDS - 1, FailsafeAction.HOLD),
        (3 * NANOSECONDS, FailsafeAction.RETURN),
    ):
        now = began + after
        told = replace(silent, stamp=now) if lost == "mode" else silent
        found = watching.assess(told, now)
        assert found.action is demand
        assert found.gravest.kind == "link_lost"
    assert found.gravest.text == "no word from the vehicle for 3 s"


@pytest.mark.parametrize(
    ("age", "demand"), [(1.0, FailsafeAction.NOTHING), (1.001, FailsafeAction.HOLD)]
)
def test_a_state_is_stale_after_a_second(age: float, demand: FailsafeAction) -> None:
    """One that is a second old still tells where the drone is."""
    assert supervisor().assess(state(stamp=10 - age), 10 * NANOSECONDS).action is demand


def test_a_silence_is_counted_from_its_beginning() -> None:
    """Nothing while the vehicle is heard, whatever was before."""
    watching = supervisor()
    assert watching.silent_for(9 * NANOSECONDS) == 0.0
    watching.assess(state(mode=VehicleMode.LOST), 10 * NANOSECONDS)
    assert watching.silent_for(14 * NANOSECONDS) == 4.0
    watching.assess(state(stamp=15.0), 15 * NANOSECONDS)
    assert watching.silent_for(16 * NANOSECONDS) == 0.0


def test_a_position_that_is_gone_for_its_time_out_lands_the_drone() -> None:
    """3 s in touch without one, counted from the first look that lacked it."""
    watching = supervisor()
    watching.assess(state(stamp=10.0), 10 * NANOSECONDS)
    nowhere = (math.nan, 0.0, 5.0)
    for second, demand in (
        (12.9, FailsafeAction.HOLD),
        (12.999, FailsafeAction.HOLD),
        (13.0, FailsafeAction.LAND),
    ):
        blind = state(at=nowhere, stamp=second, faults=("GPS: no fix",))
        found = watching.assess(blind, round(second * NANOSECONDS))
        assert found.action is demand
        assert found.gravest.kind == "no_position"
    text = "the vehicle does not know its position; GPS: no fix, for 3 s"
    assert found.gravest.text == text
    found = watching.assess(state(stamp=13.5), round(13.5 * NANOSECONDS))
    assert found is CALM
    blind = state(at=nowhere, stamp=14.0)
    assert watching.assess(blind, 14 * NANOSECONDS).action is FailsafeAction.HOLD, "it counts anew"


@pytest.mark.parametrize(
    ("mode", "kind"), [(VehicleMode.MANUAL, "pilot"), (VehicleMode.FAILSAFE, "failsafe")]
)
def test_whoever_else_flies_is_let_fly(mode: VehicleMode, kind: str) -> None:
    """Even where the battery is critical, the position unknown and the drone out of its fence."""
    found = supervisor().assess(state(0.0, at=(80.0, 0.0, 5.0), mode=mode), 0)
    assert (found.action, found.gravest.kind) == (FailsafeAction.RELEASE, kind)
    assert {one.kind for one in found.findings} == {kind, "battery_critical", "geofence"}


def test_the_gravest_of_several_is_done() -> None:
    """A critical battery outweighs a link that is lost, and outside its fence the drone holds."""
    watching = supervisor()
    watching.assess(state(mode=VehicleMode.LOST), 0)
    both = watching.assess(state(0.1, mode=VehicleMode.LOST), 0)
    assert both.action is FailsafeAction.LAND
    assert {one.kind for one in both.findings} == {"link_lost", "battery_critical"}
    outside = supervisor().assess(state(at=(51.0, 0.0, 5.0)), 0)
    assert outside.action is FailsafeAction.HOLD
    assert [one.kind for one in outside.findings] == ["geofence"]
    assert "at (51.0, 0.0, 5.0) m" in outside.findings[0].text


def test_faults_of_the_vehicle_are_told_and_demand_nothing() -> None:
    """Each by itself, in the vehicle's words."""
    found = supervisor().assess(state(faults=("GPS: 4 satellites", "compass")), 0)
    assert found.action is FailsafeAction.NOTHING
    assert [(one.kind, one.text) for one in found.findings] == [
        ("vehicle", "GPS: 4 satellites"),
        ("vehicle", "compass"),
    ]


def grounded(charge: float = 1.0, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> VehicleState:
    """A vehicle that stands."""
    return state(charge, at=at, mode=VehicleMode.GROUNDED)


@pytest.mark.parametrize(
    ("standing", "objection"),
    [
        (grounded(), None),
        (grounded(math.nan), None),
        (grounded(0.2501), None),
        (grounded(0.25), "the battery is at 25%"),
        (state(at=(0.0, 0.0, 0.0)), "the vehicle is guided, not on the ground"),
        (grounded(at=(math.nan, 0.0, 0.0)), "the vehicle does not know its position"),
        (grounded(at=(60.0, 0.0, 0.0)), "the drone stands outside its geofence"),
    ],
)
def test_a_take_off_is_refused_for_what_waiting_does_not_mend(
    standing: VehicleState, objection: str | None
) -> None:
    """Each reason by itself, and none for a drone that is ready."""
    reasons = supervisor().objections(standing)
    assert len(reasons) == (objection is not None)
    assert objection is None or objection in reasons[0]


@pytest.mark.parametrize(
    ("ceiling", "floor", "ready"), [(3, 0, True), (2.9, 0, False), (50, 3, True), (50, 3.1, False)]
)
def test_the_height_of_a_take_off_is_within_the_fence(
    ceiling: float,
    floor: float,
    ready: bool,  # noqa: FBT001
) -> None:
    """3 m are under a ceiling and over a floor of 3 m, and no farther."""
    limits = replace_limits(takeoff_height=3.0)
    fence = Geofence(GeofenceConfig(ceiling=ceiling, floor=floor))
    meter = EnergyMeter(EnergyModel(limits.endurance, np.zeros(3)))
    reasons = Supervisor(limits, np.zeros(3), fence, meter).objections(grounded())
    assert reasons == [] if ready else "leaves the geofence's heights" in reasons[0]


_NEAR = Fault(FailsafeAction.NOTHING, "traffic", "a1 is 40 m away", "a1")
_ENGINE = Fault(FailsafeAction.NOTHING, "vehicle", "motor 3 is hot")


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        (_NEAR, replace(_NEAR, text="a1 is 30 m away"), False),
        (_NEAR, replace(_NEAR, about="a2"), True),
        (_NEAR, replace(_NEAR, kind="separation"), True),
        (_ENGINE, replace(_ENGINE, text="motor 4 is hot"), False),
        (_ENGINE, replace(_ENGINE, text="the gyroscope is lost"), True),
        (_ENGINE, replace(_ENGINE, kind="wind"), True),
    ],
)
def test_a_fault_is_new_by_its_kind_and_by_what_it_is_about(
    before: Fault, after: Fault, *, told: bool
) -> None:
    """Numbers that change raise no second alert; the vehicle's own faults differ by their words."""
    found = Assessment(after, (after,)).new_findings(Assessment(before, (before,)))
    assert found == ([after] if told else [])

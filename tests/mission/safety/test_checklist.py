"""The list before take-off: what is known is judged by policy, what is not is never good."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from core_settings import core_fields
from flights import KinematicVehicle, add, square

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import GeofenceConfig, LimitsConfig, RobotConfig
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.errors import VehicleError
from aerodaas.messages.health import HealthItem, HealthReadings, Verdict, gravest
from aerodaas.messages.mission import MissionState
from aerodaas.messages.odometry import Battery, GpsFix
from aerodaas.messages.payload import CameraStatus
from aerodaas.messages.vehicle import VehicleState
from aerodaas.mission.commands import Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.mission.safety.checklist import Checklist, concerns, refusals
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

WELL = HealthReadings(
    cells=(4.1, 4.08, 4.12),
    cycles=40,
    vibration=0.2,
    compass=0.1,
    estimator=0.1,
    gps_fix=True,
    logs=True,
    wind=3.0,
    silence=0.1,
    clock=1_800_000_000.0,
    stranded=(),
    cameras=(CameraStatus("camera", free=900.0),),
)
FIX = GpsFix(47.4, 8.5, 500.0, 0.8, 1.2, 12)
POLICIES = {
    name: field
    for name, field in core_fields(PreflightConfig).items()
    if isinstance(field.default, str)
}


class Measured(KinematicVehicle):
    """A vehicle that tells of its health."""

    def __init__(self, told: HealthReadings = WELL, gps: GpsFix | None = FIX) -> None:
        super().__init__()
        self.told = told
        self.gps = gps

    def health(self) -> HealthReadings:
        """Its readings."""
        return self.told

    def read(self) -> VehicleState:
        """Its state, with a GPS."""
        return replace(super().read(), gps=self.gps)


def listed(
    vehicle: KinematicVehicle,
    policy: dict[str, str] | None = None,
    limits: LimitsConfig | None = None,
) -> dict[str, HealthItem]:
    """The core's items by name."""
    judged = PreflightConfig.model_validate(policy or {})
    checklist = Checklist(vehicle, limits or LimitsConfig(), judged)
    core = {"vehicle", "battery", "fence", "faults", *POLICIES}
    items = checklist.examine(vehicle.read())
    return {item.name: item for item in items if item.name in core}


def test_a_vehicle_that_is_well() -> None:
    """Every item that is looked at is good, and has no remedy."""
    items = listed(Measured())
    assert set(items) == {"vehicle", "battery", "fence", *POLICIES}
    assert {item.verdict for item in items.values()} == {Verdict.GOOD}
    assert not any(item.remedy for item in items.values())
    assert refusals(list(items.values())) == concerns(list(items.values())) == []


ILL: list[tuple[str, dict[str, Any], str]] = [
    ("cells", {"cells": (4.1, 3.4, 4.1)}, "3 cells from 3.40 V"),
    ("cells", {"cells": (4.1, 3.9, 4.1)}, "0.20 V apart"),
    ("battery_age", {"cycles": 301}, "301 cycles"),
    ("vibration", {"vibration": 15.1}, "15.1 m/s²"),
    ("compass", {"compass": 0.81}, "misfit 0.81"),
    ("gps", {"gps_fix": False}, "no fix"),
    ("estimator", {"estimator": 0.81}, "misfit 0.81"),
    ("storage", {"logs": False}, "it does not write its log, should be able to write its log"),
    ("wind", {"wind": 10.1}, "10.1 m/s"),
    ("daylight", {"clock": 1_800_000_000.0 + 43_200.0}, "sun at -"),
    ("link", {"silence": 1.6}, "1.6 s ago"),
    ("fallback", {"stranded": ("it hovers",)}, "it hovers, should be able to come home without us"),
    (
        "camera",
        {"cameras": (CameraStatus("camera", trouble="it has no card"), CameraStatus("other"))},
        "camera: tells nothing of itself; it has no card; other: tells nothing",
    ),
]


@pytest.mark.parametrize(("name", "change", "word"), ILL)
def test_each_item_alone(name: str, change: dict[str, Any], word: str) -> None:
    """By policy it warns, refuses, or is not looked at; no other item minds it."""
    vehicle = Measured(replace(WELL, **change))
    for level, verdict in (
        ("warn", Verdict.WARNING),
        ("refuse", Verdict.REFUSED),
        ("require", Verdict.REFUSED),
    ):
        items = listed(vehicle, {name: level})
        assert items[name].verdict is verdict
        assert word in items[name].text
        assert items[name].remedy
        others = {item.verdict for other, item in items.items() if other != name}
        assert others == {Verdict.GOOD}
        assert bool(refusals(list(items.values()))) is (verdict is Verdict.REFUSED)
    assert name not in listed(vehicle, {name: "ignore"})


def test_corrections_are_told_beside_the_satellites() -> None:
    """They are no condition: whether they are precise enough is a question of accuracy."""
    item = listed(Measured(replace(WELL, gps_rtk="RTK fixed")), {})["gps"]
    assert item.value == "12 satellites, within 0.8 m, RTK fixed"
    assert item.verdict is Verdict.GOOD


def test_ill_covers_every_item() -> None:
    """None is left without a test."""
    assert {name for name, *_ in ILL} == set(POLICIES)


@pytest.mark.parametrize("name", sorted(POLICIES))
def test_what_is_not_known_is_not_good(name: str) -> None:
    """Nobody is warned of it, but whoever requires it does not take off."""
    vehicle = Measured(HealthReadings(), gps=None)
    for level, verdict in (
        ("warn", Verdict.UNKNOWN),
        ("refuse", Verdict.UNKNOWN),
        ("require", Verdict.REFUSED),
    ):
        item = listed(vehicle, {name: level})[name]
        assert (item.value, item.verdict) == ("not known", verdict)


def test_numbers_that_are_none_are_not_known() -> None:
    """NaN is no wind of zero."""
    item = listed(Measured(replace(WELL, wind=float("nan"))), {"wind": "require"})["wind"]
    assert (item.value, item.verdict) == ("not known", Verdict.REFUSED)


@pytest.mark.parametrize(
    ("gps", "good"),
    [
        (FIX, True),
        (replace(FIX, satellites=6), True),
        (replace(FIX, satellites=5), False),
        (replace(FIX, satellites=0), True),
        (replace(FIX, horizontal_sigma=5.1), False),
        (None, False),
    ],
)
def test_a_gps_by_satellites_and_accuracy(gps: GpsFix | None, *, good: bool) -> None:
    """Zero satellites with a fix are an untold number."""
    assert (listed(Measured(gps=gps))["gps"].verdict is Verdict.GOOD) is good


@pytest.mark.parametrize(
    ("fault", "name"),
    [
        ("compass: unhealthy", "compass"),
        ("second compass: unhealthy", "compass"),
        ("GPS: no fix", "gps"),
        ("estimator: attitude unknown", "estimator"),
        ("log: unhealthy", "storage"),
        ("vibration: more than 60 m/s²", "vibration"),
        ("battery: a cell has failed", "cells"),
    ],
)
def test_what_the_vehicle_says_of_an_item_counts_most(fault: str, name: str) -> None:
    """Its figures may be good all the same."""
    vehicle = Measured()
    vehicle.faults = (fault,)
    item = listed(vehicle, {name: "refuse"})[name]
    assert item.verdict is Verdict.REFUSED
    assert item.value == fault.partition(": ")[2]


@pytest.mark.parametrize("fault", ["gyroscope: unhealthy", ": unhealthy", "unhealthy"])
def test_other_faults_are_listed(fault: str) -> None:
    """Under their own name, whatever comes before the colon."""
    vehicle = Measured()
    vehicle.faults = (fault,)
    item = listed(vehicle)["faults"]
    assert (item.value, item.verdict) == (fault, Verdict.WARNING)


def test_battery_fence_and_the_vehicle_itself_are_no_matter_of_policy() -> None:
    """They refuse; an unknown charge is said as one."""
    vehicle = Measured()
    vehicle.objections = ["the propellers are off"]
    vehicle.charge = 0.2
    fence = GeofenceConfig(polygon=[(5, 5), (9, 5), (9, 9)])
    items = listed(vehicle, limits=LimitsConfig(geofence=fence))
    for name, word in (("vehicle", "propellers"), ("battery", "20%"), ("fence", "outside")):
        assert items[name].verdict is Verdict.REFUSED
        assert word in items[name].text
        assert items[name].remedy
    state = replace(vehicle.read(), battery=Battery(float("nan")))
    checklist = Checklist(vehicle, LimitsConfig(), PreflightConfig())
    battery = checklist.examine(state)[1]
    assert (battery.name, battery.value, battery.verdict) == (
        "battery",
        "not known",
        Verdict.UNKNOWN,
    )


def test_a_driver_without_health_knows_little() -> None:
    """Nothing of it is said to be good."""
    items = listed(KinematicVehicle())
    assert {items[name].verdict for name in POLICIES if name in items} == {Verdict.UNKNOWN}


def test_a_driver_that_cannot_tell_now_knows_nothing() -> None:
    """Its own objections say what is missing."""

    class Broken(Measured):
        def health(self) -> HealthReadings:
            raise VehicleError("not connected")

    assert listed(Broken())["wind"].verdict is Verdict.UNKNOWN


class Flown:
    """A mission of one waypoint, up to its take-off or its end."""

    def __init__(self, vehicle: Measured, **policy: Any) -> None:  # noqa: ANN401
        robot = RobotConfig(
            id="drone",
            limits=LimitsConfig(preflight_timeout=1.0),
            preflight=PreflightConfig(**policy),
        )
        self.mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=np.zeros(3))
        loop = self.loop = SetpointLoop(vehicle, self.mission)
        for command in (add(*square()), Start()):
            self.mission.handle(command, 0)
        now = 0
        while self.mission.state in {MissionState.IDLE, MissionState.PREFLIGHT}:
            now += NANOSECONDS // 20
            assert now < 10 * NANOSECONDS
            loop.step(now)

    @property
    def alerts(self) -> Iterator[str]:
        """What people were told."""
        return (alert.text for alert in self.mission.alerts)


def test_a_refused_take_off_names_the_item() -> None:
    """With what it is and what it should be."""
    flown = Flown(Measured(replace(WELL, wind=12.0)), wind="refuse")
    assert flown.mission.state is MissionState.ABORTED
    reason = "take-off refused: wind: 12.0 m/s, should be at most 10"
    assert flown.mission.status.reason == reason
    assert list(flown.alerts) == [reason]


def test_a_warning_is_told_and_the_drone_takes_off() -> None:
    """Once, and only where there is something to tell."""
    flown = Flown(Measured(replace(WELL, wind=12.0)))
    assert flown.mission.state is MissionState.TAKING_OFF
    assert list(flown.alerts) == ["wind: 12.0 m/s, should be at most 10"]
    assert list(Flown(Measured()).alerts) == []


def test_what_is_required_and_unknown_keeps_it_on_the_ground() -> None:
    """As a vehicle that does not tell."""
    flown = Flown(Measured(replace(WELL, estimator=None)), estimator="require")
    assert flown.mission.status.reason.startswith("take-off refused: estimator: not known")


def test_what_gets_better_in_time_does_not_refuse() -> None:
    """Within `preflight_timeout`."""

    class Settling(Measured):
        looks = 0

        def health(self) -> HealthReadings:
            Settling.looks += 1
            return replace(WELL, estimator=2.0 if Settling.looks < 10 else 0.1)

    assert Flown(Settling(), estimator="refuse").mission.state is MissionState.TAKING_OFF


def test_the_list_is_kept_as_it_was_before_take_off() -> None:
    """For those who look on; what the air brings later is no matter of it."""
    vehicle = Measured(replace(WELL, wind=12.0))
    flown = Flown(vehicle)
    kept = flown.loop.health
    assert kept.verdict is Verdict.WARNING
    assert kept.age is not None
    vehicle.told = WELL
    flown.loop.step(flown.mission.status.stamp + 5 * NANOSECONDS)
    assert flown.loop.health.items == kept.items
    assert flown.loop.health.age == pytest.approx(kept.age + 5.0)


def test_a_mission_that_has_not_begun_goes_through_the_list_each_second() -> None:
    """And is held up by nothing in it yet."""
    vehicle = Measured(replace(WELL, wind=12.0))
    robot = RobotConfig(id="drone", preflight=PreflightConfig(wind="refuse"))
    mission = Mission(robot, InlinePlanner(OrderedScheduler()), takeoff=np.zeros(3))
    loop = SetpointLoop(vehicle, mission)
    seen = []
    for turn in range(41):
        loop.step(turn * NANOSECONDS // 20)
        if loop.health.age == 0.0:
            seen.append(turn)
    assert seen == [0, 20, 40]
    assert mission.state is MissionState.IDLE


@pytest.mark.parametrize(
    ("verdicts", "worst"),
    [
        ("good unknown", "good"),
        ("good warning unknown", "warning"),
        ("warning refused good", "refused"),
        ("", "good"),
    ],
)
def test_the_gravest_item_speaks_for_the_list(verdicts: str, worst: str) -> None:
    """What is not known and was not required to be keeps nobody on the ground."""
    items = [HealthItem("one", "", "", Verdict(word)) for word in verdicts.split()]
    assert gravest(items) is Verdict(worst)

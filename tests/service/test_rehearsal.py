"""Missions flown in the rehearsal's environment, in simulated time, and judged by recordings."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from flying import Flyer
from rehearsed import FIELD, rehearse, to_the_east

from aerodaas import AeroNavigation, Environment, NavigationType, Waypoint
from aerodaas.config.model import validated
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.errors import ConfigError
from aerodaas.messages.health import Verdict
from aerodaas.mission.safety.checklist import Checklist
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.service.flights.environment import rehearsal_config
from aerodaas.service.flights.orders import OtherLease
from aerodaas.service.rehearsal.findings import judge
from aerodaas.service.rehearsal.picture import draw
from aerodaas.simulation.airframe import Airframe

AHEAD = OtherLease(id="b7", area=[(5.0, 4.0), (9.0, 4.0), (9.0, 9.0), (5.0, 9.0)])
"""Another's area around the second waypoint."""
FLEET: dict[str, Any] = {
    "name": "fleet",
    "robots": [
        {
            "id": "px4",
            "driver": "mavlink",
            "settings": {"url": "udpin:127.0.0.1:14540"},
            "limits": {"endurance": 600},
            "sensors": [
                {
                    "id": "cam",
                    "driver": "video",
                    "rate": 5,
                    "settings": {
                        "path": "rtsp://camera/1",
                        "pitch": 30,
                        "width": 320,
                        "gimbal": {},
                    },
                },
                {"id": "odom", "type": "odometry"},
            ],
        },
        {"id": "tello", "driver": "tello", "sensors": [{"id": "front"}]},
        {"id": "own", "driver": "simulated", "settings": {"mass": 1.5, "battery": 0.9}},
    ],
    "sensors": [{"id": "phone", "type": "gps", "settings": {"path": "log.csv"}}],
    "simulation": {"world": "campus", "seed": 3, "wind": [1, 0, 0]},
}


def test_the_fleet_becomes_a_simulated_one() -> None:
    """Drivers and cameras; limits, geometry, world and wind stay; charge and seed are as given."""
    whole = validated(FLEET, "fleet")
    config = rehearsal_config(whole, {"px4": 0.5, "own": 0.4}, seed=8)
    assert [robot.driver for robot in config.robots] == ["simulated"] * 3
    assert all(config.camera_driver(one) == "simulated" for one in config.all_sensors())
    assert config.robots[0].sensors[0].settings == {"pitch": 30, "width": 320, "gimbal": {}}
    assert config.sensors == whole.sensors
    assert config.robots[2].settings == {"mass": 1.5, "battery": 0.4}
    assert config.simulation == whole.simulation.model_copy(update={"seed": 8})
    for one, other in zip(config.robots, whole.robots, strict=True):
        assert (one.limits, one.mission, one.start) == (other.limits, other.mission, other.start)
        vehicle = SimulatedVehicle(one, config)
        vehicle.connect()
        assert vehicle.read().battery.fraction == {"px4": 0.5, "tello": 1.0, "own": 0.4}[one.id]
    assert rehearsal_config(whole, {}).simulation == whole.simulation


def test_a_twin_is_not_asked_for_what_only_an_autopilot_knows() -> None:
    """What must be known of a real vehicle is not known of its twin; what is known counts."""
    policy = {"vibration": "require", "gps": "require", "wind": "require", "link": "refuse"}
    fleet = [{**one, "preflight": policy} for one in FLEET["robots"]]
    windy = {**FLEET["simulation"], "wind": [12, 0, 0]}
    whole = validated({**FLEET, "robots": fleet, "simulation": windy}, "fleet")
    refused = {}
    for robot in (config := rehearsal_config(whole, {})).robots:
        vehicle = SimulatedVehicle(robot, config)
        vehicle.connect()
        items = Checklist(vehicle, robot.limits, robot.preflight).examine(vehicle.read())
        refused[robot.id] = {one.name for one in items if one.verdict is Verdict.REFUSED}
    assert refused["px4"] == refused["tello"] == {"wind"}
    assert refused["own"] == {"wind", "vibration", "gps"}, "as it will be in its flight"
    assert config.robots[2].preflight == whole.robots[2].preflight


def test_a_charge_beyond_full_is_refused() -> None:
    """With the drone's name."""
    with pytest.raises(ConfigError, match=r"the rehearsal of px4: .*battery"):
        rehearsal_config(validated(FLEET, "fleet"), {"px4": 1.5})


def test_a_rehearsed_battery_hovers_for_the_real_ones_endurance() -> None:
    """Within a tenth of the ten minutes that the limits say."""
    config = rehearsal_config(validated(FLEET, "fleet"), {})
    vehicle = SimulatedVehicle(config.robots[0], config)
    vehicle.connect()
    vehicle.take_off(2.0)
    second = 1_000_000_000
    for now in range(1, 61):
        vehicle.advance_to(now * second)
    assert Airframe.model_validate(config.robots[0].settings).mass == 2.0
    used = 1.0 - vehicle.read().battery.fraction
    assert 60.0 / used == pytest.approx(600.0, rel=0.1)


def test_a_good_flight_is_approved_and_the_same_one_near_another_lease_is_not(
    flyer: Flyer, tmp_path: Path
) -> None:
    """One flight, judged three times; its picture shows the other's area and the place."""
    flown = rehearse(flyer)
    good = judge(flown.recording, flown.config, minutes=2)
    assert good.approved
    assert good.reasons == []
    assert good.seconds is not None
    assert 10.0 < good.seconds < 60.0
    assert good.distance == pytest.approx(24.0, abs=3.0)
    assert good.battery_used is not None
    assert 0.005 < good.battery_used < 0.05
    track = good.tracks["drone"]
    assert len(track) < 100
    assert max(math.dist(one, other) for one, other in itertools.pairwise(track)) < 1.0
    for east, north in ((6.0, 0.0), (6.0, 6.0), (0.0, 0.0)):
        assert min(math.dist((east, north), place[:2]) for place in track) < 1.0
    near = judge(flown.recording, flown.config, minutes=2, others=[AHEAD])
    assert not near.approved
    assert "flew into the area of lease b7" in near.reasons[0]
    late = judge(flown.recording, flown.config, minutes=0.1, others=[AHEAD])
    assert len(late.reasons) == 2
    clear, refused = tmp_path / "clear.png", tmp_path / "refused.png"
    draw(flown.recording, clear, flown.config, minutes=2)
    draw(flown.recording, refused, flown.config, minutes=2, others=[AHEAD])
    assert _vermilion(refused) > _vermilion(clear) + 500


def _vermilion(picture: Path) -> int:
    """Pixels in the colour of other leases and of places of refusal."""
    image = cv2.imread(str(picture))
    assert image is not None
    assert min(image.shape[:2]) > 500
    return int((np.abs(image.astype(int) - (0, 94, 213)).max(axis=2) < 30).sum())


def test_a_flight_that_the_fence_stops_is_refused(flyer: Flyer) -> None:
    """Steered against it by an analysis: it stays inside, and what stopped it is told."""
    fence = {"polygon": [(-5, -5), (8, -5), (8, 5), (-5, 5)], "ceiling": 20}
    flown = rehearse(flyer, to_the_east, limits={"geofence": fence, "command_timeout": 0.5})
    verdict = judge(flown.recording, flown.config, minutes=5)
    assert not verdict.approved
    (reason,) = verdict.reasons
    assert "the fence changed" in reason
    assert "plan further inside it, or lease a larger area" in reason


def test_a_battery_too_low_for_the_way_is_refused(flyer: Flyer) -> None:
    """With the present charge the drone turns round before its end."""
    flown = rehearse(flyer, driver="mavlink", battery=0.257, limits={"battery_land": 0.25})
    verdict = judge(flown.recording, flown.config, minutes=5)
    assert not verdict.approved
    assert any("battery low" in reason for reason in verdict.reasons)
    assert any("ended with 25%, below the reserve of 25%" in one for one in verdict.reasons)


def test_a_drone_that_does_not_take_off_is_refused(flyer: Flyer) -> None:
    """Its own words are the reason."""
    flown = rehearse(flyer, battery=0.1)
    verdict = judge(flown.recording, flown.config, minutes=5)
    assert not verdict.approved
    assert "did not land as planned: aborted: take-off refused" in verdict.reasons[0]
    assert verdict.seconds is None


def straight_to(*places: tuple[float, float], height: float) -> Callable[[Environment], None]:
    """A mission straight to these places."""

    def build(env: Environment) -> None:
        stops = [Waypoint(f"wp{n}", x, y, height) for n, (x, y) in enumerate(places)]
        env.get_robot_by_id("drone").navigate(AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops))

    return build


def test_a_flight_into_a_barn_is_refused(flyer: Flyer) -> None:
    """It ends there, and each reason names what was hit and where."""
    flown = rehearse(flyer, straight_to((24, 17), height=2.0), world="field")
    verdict = judge(flown.recording, flown.config, minutes=5)
    assert not verdict.approved
    assert verdict.clearance is not None
    assert (verdict.clearance.distance, verdict.clearance.thing) == (0.0, "barn")
    assert verdict.seeds == [5]
    ended, hit = verdict.reasons
    assert "aborted: collision with building barn at (2" in ended
    assert hit.startswith("drone hit building barn at (2")
    with Recording.open(flown.recording) as recording:
        alerts = RecordedFlight.read(recording).alerts
    (collision,) = [text for _, kind, text in alerts if kind == "collision"]
    assert collision in ended


@pytest.mark.parametrize(("height", "approved"), [(1.4, False), (1.9, True)])
def test_a_flight_past_a_fence_tells_how_near_it_came(
    flyer: Flyer, height: float, *, approved: bool
) -> None:
    """By the true positions, between take-off and landing; above 0.5 m it is good."""
    flown = rehearse(flyer, straight_to((5, 5), (16, 5), height=height), world="field")
    verdict = judge(flown.recording, flown.config, minutes=5)
    assert verdict.approved is approved
    near = verdict.clearance
    assert near is not None
    assert (near.thing, near.label, near.robot) == ("fence", "fence", "drone")
    assert near.distance == pytest.approx(height - 1.1, abs=0.15)
    assert near.place[0] == pytest.approx(14.0, abs=0.5)


def test_what_stands_beside_the_start_is_no_near_miss(flyer: Flyer) -> None:
    """A drone takes off and lands within half a metre of a fence; in an empty world is none."""
    drone = {**FIELD["robots"][0], "start": [13.5, 5.0, 0.0]}
    config = {**FIELD, "robots": [drone], "simulation": {"world": "field"}}
    flyer.fly(straight_to((-6, 0), height=3.0), config, seed=5)
    (recording,) = flyer.folder.glob("flight/*.mcap")
    verdict = judge(recording, validated(config, "the field"), minutes=5)
    assert verdict.reasons == []
    assert verdict.clearance is not None
    assert verdict.clearance.distance > 0.5


def test_an_empty_world_has_no_clearance(flyer: Flyer) -> None:
    """Nothing is near."""
    flown = rehearse(flyer)
    assert judge(flown.recording, flown.config, minutes=2).clearance is None

"""Vehicle states come out of a recording as they went in."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from filled import filled
from rewritten import fields, rewritten, with_field
from synthetic_flight import PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import RECENT, MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import GimbalAttitude
from aerodaas.messages.vehicle import FlightEnd, Traffic, VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.log import MissionLog
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.report import read_report

ODOMETRY = Odometry(np.array([1, 2, 3.5]), np.array([-0.1, 0.2, 1 / 3]), 0.1, 0.2, 0.3, 0.4, 0.5)
TRUTH = Odometry(np.array([1.5, 2.5, 3.0]), np.zeros(3), -1.0, 0.0, 0.1, -0.2)
FULL = VehicleState(
    5_000_000_000,
    ODOMETRY,
    Battery(0.75, 7.5, 2.5),
    VehicleMode.GUIDED,
    armed=True,
    gps=GpsFix(12.5, 77.5, 900.0, 1.5, 2.5, 9),
    truth=TRUTH,
    faults=("compass", "link weak"),
    extra={"temperature": 60.5, "link": 0.25},
    ended=FlightEnd.FELL,
    traffic=(
        Traffic(0x4B1234, "HBXYZ", np.array([1 / 3, -2.0, 80.5]), np.array([50.0, 0.1, -2.0]), 0.3),
        Traffic(7, "000007", np.array([9.0, 8.0, math.nan]), np.zeros(3)),
    ),
)
SPARE = VehicleState(6_000_000_000, TRUTH, Battery(0.5), VehicleMode.MANUAL, armed=False)


def played(path: Path, *states: tuple[str, VehicleState]) -> dict[str, list[VehicleState]]:
    """Record states, each 20 ms after its own stamp, and read them back by robot."""
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for seq, (robot, state) in enumerate(states):
            stream = f"{robot}/@state"
            header = Header(seq, state.stamp, stream)
            stamp = state.stamp + 20_000_000
            recorder.write(Message(stream, seq, stamp, header, 0, (), state))
    found: dict[str, list[VehicleState]] = {}
    with Recording.open(path) as recording:
        for robot in ("a", "b", "c"):
            told = list(vehicle_states(recording, robot))
            assert [stamp for stamp, _ in told] == [it.stamp + 20_000_000 for _, it in told]
            found[robot] = [state for _, state in told]
    return found


def test_states_come_back_whole_for_each_robot(tmp_path: Path) -> None:
    """With everything or with next to nothing in them; the robot asked for, and no other."""
    found = played(tmp_path / "a.mcap", ("a", FULL), ("b", SPARE), ("a", SPARE))
    assert found == {"a": [FULL, SPARE], "b": [SPARE], "c": []}
    assert found["a"][0].ended is FlightEnd.FELL
    assert found["a"][0].mode is VehicleMode.GUIDED
    assert found["a"][1].gps is None
    assert found["a"][1].truth is None
    assert found["a"][1].ended is None


@pytest.mark.parametrize("odd", [..., None, [], {}, "x", -1, True], ids=repr)
def test_a_strangers_state_is_whole_or_left_out(tmp_path: Path, odd: object) -> None:
    """Each part of it may be anything, or missing: nothing that reads it raises."""
    path, states = tmp_path / "a.mcap", [filled(VehicleState, stamp=stamp) for stamp in range(200)]
    played(path, *(("a", state) for state in states))
    turns = itertools.count()

    def change(topic: str, data: bytes) -> bytes:
        if topic != "/a/state":
            return data
        value = json.loads(data)
        places = fields(value)
        return json.dumps(with_field(value, places[next(turns) % len(places)], odd)).encode()

    with Recording.open(rewritten(path, tmp_path / "odd.mcap", change=change)) as recording:
        for _, state in vehicle_states(recording, "a"):
            repr(state)
            assert isinstance(state.gimbal, GimbalAttitude | None)


def test_what_was_not_a_number_is_none_again(tmp_path: Path) -> None:
    """Unknown volts, a velocity and a height that were not measured; a position that was."""
    odometry = Odometry(np.array([1.0, 2.0, np.nan]), np.full(3, np.nan), 0.5)
    state = VehicleState(
        1,
        odometry,
        Battery(0.5, math.nan, math.nan),
        VehicleMode.MANUAL,
        armed=False,
        gps=GpsFix(1.0, 2.0, math.nan, 1.0, math.nan),
    )
    ((back,),) = (states for states in played(tmp_path / "a.mcap", ("a", state)).values() if states)
    assert np.array_equal(back.odometry.position, [1.0, 2.0, np.nan], equal_nan=True)
    assert np.isnan(back.odometry.velocity).all()
    assert back.odometry.yaw == 0.5
    assert (back.battery.fraction, math.isnan(back.battery.voltage)) == (0.5, True)
    assert math.isnan(back.battery.current)
    assert back.gps is not None
    assert (back.gps.latitude, back.gps.longitude) == (1.0, 2.0)
    assert math.isnan(back.gps.altitude)
    assert math.isnan(back.gps.vertical_sigma)


def test_a_report_counts_a_waypoint_once(tmp_path: Path) -> None:
    """One that an application sends again after it was visited is visited again, and is one."""
    late = Waypoint("late", 1, 1, 2)
    statuses = [
        MissionStatus(0, MissionState.ENROUTE, "", late, (Waypoint("a", 2, 2, 2),)),
        MissionStatus(1, MissionState.ENROUTE, "", late, (), ("late",), visits=1),
        MissionStatus(2, MissionState.LANDED, "", None, (), ("late", "late"), visits=2),
    ]
    path = tmp_path / "a.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for seq, status in enumerate(statuses):
            header = Header(seq, status.stamp, "a/@mission")
            recorder.write(Message("a/@mission", seq, status.stamp, header, 0, (), status))
    robot = read_report(path).summary.robots["a"]
    assert (robot.waypoints_visited, robot.waypoints_planned) == (1, 2)


def test_all_visits_of_a_long_flight_are_found_again(tmp_path: Path) -> None:
    """A status names the last few only, and one of them may be lost on its way to the recorder."""
    log = MissionLog("a")
    path = tmp_path / "a.mcap"
    names = [f"w{number}" for number in range(300)]
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for seq, name in enumerate(names):
            log.visit(name)
            log.give_up(seq, f"not-{name}", "too far")
            if seq % 7 == 3:
                continue
            status = MissionStatus(
                seq,
                MissionState.ENROUTE,
                visited=tuple(log.visited),
                given_up=tuple(log.given_up)[-RECENT:],
                visits=log.visits,
            )
            assert len(status.visited) <= RECENT
            recorder.write(Message("a/@mission", seq, seq, Header(seq, seq, "a"), 0, (), status))
    with Recording.open(path) as recording:
        robot = RecordedFlight.read(recording).robots["a"]
    assert robot.visited == tuple(names)
    assert robot.given_up == tuple(f"not-{name}" for name in names)

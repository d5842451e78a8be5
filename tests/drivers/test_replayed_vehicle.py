"""The vehicle of a replay shows what was recorded, when it was recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aerodaas.config.model import EnvironmentConfig, RecordingConfig, RobotConfig
from aerodaas.config.plugins import load_plugin
from aerodaas.errors import ConfigError, RecordingError, VehicleError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.vehicle import (
    FlightEnd,
    PlayedVehicle,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.vehicle import ReplayedVehicle

ENVIRONMENT = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
STEP = 50_000_000
MODES = [VehicleMode.GROUNDED] * 4 + [VehicleMode.TAKING_OFF] * 3 + [VehicleMode.GUIDED] * 3


def state(number: int) -> VehicleState:
    """A state with figures that a decimal notation could spoil."""
    third = number / 3
    odometry = Odometry(np.array([third, -third, 0.1]), np.array([0.1, 0.2, 0.3]), third, 0.1, 0.2)
    return VehicleState(
        number * STEP,
        odometry,
        Battery(float("nan") if number == 5 else 0.9, 15.1),
        MODES[number],
        armed=number > 2,
        gps=GpsFix(12.97 + third * 1e-6, 77.59, 900.0, 0.5, 1.0, 12),
        truth=odometry,
        faults=("cold",),
        extra={"link": third},
        ended=FlightEnd.LANDED if number < 3 else None,
    )


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """Ten states of a drone that had to wait for its third turn to take off."""
    path = tmp_path / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance()) as recorder:
        for number in range(10):
            stamp = number * STEP
            for stream, item in (
                ("drone/@state", state(number)),
                (
                    "drone/@status",
                    MissionStatus(
                        stamp,
                        MissionState.PREFLIGHT if number < 3 else MissionState.TAKING_OFF,
                    ),
                ),
            ):
                header = Header(number, stamp, stream)
                recorder.write(Message(stream, number, stamp, header, 0, (), item))
    return path


def vehicle(path: Path, **settings: object) -> ReplayedVehicle:
    """A replayed drone."""
    robot = RobotConfig(id="drone", driver="replayed", settings={"path": str(path), **settings})
    made: ReplayedVehicle = load_plugin("drivers", "replayed")(robot, ENVIRONMENT)
    return made


def test_states_come_back_at_their_times(recorded: Path) -> None:
    """Exact to the last digit, and never from the future."""
    drone = vehicle(recorded)
    assert isinstance(drone, PlayedVehicle)
    drone.connect()
    for number in range(10):
        for stamp in (number * STEP, number * STEP + STEP - 1):
            drone.advance_to(stamp)
            shown, expected = drone.read(), state(number)
            assert shown.stamp == expected.stamp
            assert np.array_equal(shown.odometry.position, expected.odometry.position)
            assert shown.odometry.yaw == expected.odometry.yaw
            assert (shown.mode, shown.armed) == (expected.mode, expected.armed)
            assert (shown.gps, shown.extra, shown.faults) == (
                expected.gps,
                expected.extra,
                expected.faults,
            )
            assert np.isnan(shown.battery.fraction) == (number == 5)
    drone.close()


def test_it_ends_after_the_last_state(recorded: Path) -> None:
    """The last state is still shown; the moment after it, the replay is over."""
    drone = vehicle(recorded)
    drone.connect()
    drone.advance_to(9 * STEP)
    assert not drone.finished
    drone.advance_to(9 * STEP + 1)
    assert drone.finished


def test_it_objects_for_as_long_as_the_recorded_one_did(recorded: Path) -> None:
    """What kept the recorded mission on the ground keeps the replayed one there, too."""
    drone = vehicle(recorded)
    drone.connect()
    objections = []
    for number in range(5):
        drone.advance_to(number * STEP)
        objections.append(bool(drone.preflight()))
    assert objections == [True, True, True, False, False]


def test_setpoints_are_refused_where_they_were(recorded: Path) -> None:
    """On the ground and while taking off; in the air they are taken, and change nothing."""
    drone = vehicle(recorded)
    drone.connect()
    asked = VelocitySetpoint(np.array([1.0, 0.0, 0.0]))
    for stamp in (0, 5 * STEP):
        drone.advance_to(stamp)
        with pytest.raises(VehicleError, match="takes no setpoints"):
            drone.send(asked)
    drone.advance_to(8 * STEP)
    assert drone.send(asked) is asked
    before = drone.read()
    drone.land()
    assert drone.read() is before


def test_it_claims_what_the_recorded_driver_offered(recorded: Path) -> None:
    """Capabilities shape setpoints, so they must be the recorded ones."""
    drone = vehicle(recorded, driver="simulated", settings={"max_speed": 3.5})
    assert drone.capabilities.driver == "simulated"
    assert drone.capabilities.max_speed == 3.5


def test_what_cannot_be_replayed_is_named(recorded: Path, tmp_path: Path) -> None:
    """A missing file, another robot, an unknown setting."""
    with pytest.raises(RecordingError, match="cannot open"):
        vehicle(tmp_path / "none.mcap").connect()
    robot = RobotConfig(id="other", driver="replayed", settings={"path": str(recorded)})
    with pytest.raises(VehicleError, match="no states of other"):
        ReplayedVehicle(robot, ENVIRONMENT).connect()
    with pytest.raises(ConfigError, match="path"):
        vehicle(recorded, speed=3)

"""Vehicle that plays the states of a recording and ignores commands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import ClassVar

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.config.sections.actuators import ACTUATOR_TYPES
from aerodaas.drivers.loading import load_vehicle
from aerodaas.errors import ConfigError, VehicleError
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import Capabilities, Setpoint, VehicleMode, VehicleState
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.simulation.equipment import simulated_equipment

__all__ = ["ReplayedVehicle"]

_ON_ITS_OWN = {VehicleMode.GROUNDED, VehicleMode.TAKING_OFF, VehicleMode.FAILSAFE}
"""Modes in which the recorded vehicle took no setpoints."""
_WAITING = {MissionState.IDLE, MissionState.PREFLIGHT}


class ReplayedVehicle:
    """Vehicle whose state is that recorded at the mission time; a `vehicle.PlayedVehicle`.

    Settings: `path` of the recording, and `driver` and `settings` of the recorded robot, whose
    capabilities it reports. Commands have no effect; setpoints are accepted in the modes in
    which the recorded vehicle accepted them. Its equipment does as it is told, and moves nothing.
    """

    actuator_types: ClassVar[frozenset[str]] = ACTUATOR_TYPES
    """What a recorded vehicle may have carried."""

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:
        """Check the settings of `robot`; raises ConfigError."""
        known = {"path", "driver", "settings"}
        if not {"path"} <= set(robot.settings) <= known:
            raise ConfigError(f'robot {robot.id}: a replayed vehicle has the settings "path", '
                              '"driver" and "settings"')  # fmt: skip
        self._id = robot.id
        self.equipment = simulated_equipment(robot, environment, lambda: None, replayed=True)
        self._path = str(robot.settings["path"])
        self._capabilities = _capabilities(robot, environment)
        self._states: Iterator[tuple[int, VehicleState]] = iter(())
        self._now = 0
        self._ready_at = 0
        self._current: VehicleState | None = None
        self._next: tuple[int, VehicleState] | None = None
        self._last = 0

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities of the recorded vehicle's driver, except that it obeys no commands."""
        return self._capabilities

    @property
    def finished(self) -> bool:
        """True after the last recorded state."""
        return self._next is None and self._now > self._last

    def connect(self, timeout: float = 10.0) -> None:  # noqa: ARG002 - a file does not make us wait
        """Open the recording; raises RecordingError, or VehicleError without the robot's states."""
        self._recording = Recording.open(self._path)
        self._ready_at = self._when_ready()
        self._states = vehicle_states(self._recording, self._id)
        first = next(self._states, None)
        if first is None:
            raise VehicleError(f"{self._path} holds no states of {self._id}; did it fly then?")
        self._last, self._current = first
        self._next = next(self._states, None)

    def advance_to(self, stamp: int) -> None:
        """Advance to the newest state recorded up to mission time `stamp`, in nanoseconds."""
        self._now = stamp
        for one in self.equipment:
            one.advance_to(stamp)
        while self._next is not None and self._next[0] <= stamp:
            self._last, self._current = self._next
            self._next = next(self._states, None)

    def read(self) -> VehicleState:
        """Return the current state; raise VehicleError if not connected."""
        if self._current is None:
            raise VehicleError(f"{self._id} is not connected; call connect first")
        return self._current

    def preflight(self) -> list[str]:
        """Return an objection until the recorded mission had passed its preflight checks."""
        return [] if self._now >= self._ready_at else ["the recorded vehicle was not ready yet"]

    def send(self, setpoint: Setpoint) -> Setpoint:
        """Return `setpoint`; raise VehicleError in modes in which the vehicle refused it."""
        mode = self.read().mode
        if mode in _ON_ITS_OWN:
            raise VehicleError(f"{self._id} takes no setpoints while {mode.value}")
        return setpoint

    def take_off(self, height: float) -> None:
        """Do nothing: it takes off at the recorded time."""

    def hold(self) -> None:
        """Do nothing."""

    def return_home(self) -> None:
        """Do nothing."""

    def land(self) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Close the recording."""
        if self._current is not None:
            self._recording.close()
            self._current = None

    def _when_ready(self) -> int:
        """Mission time at which the recorded mission stopped waiting for the vehicle.

        The states do not contain the reason for the wait.
        """
        for record in self._recording.records(schemas=("aerodaas.MissionStatus",)):
            if record.labels.robot == self._id and record.value.state not in _WAITING:
                return record.stamp
        return 0


def _capabilities(robot: RobotConfig, environment: EnvironmentConfig) -> Capabilities:
    driver = robot.settings.get("driver")
    if driver is None:
        return Capabilities("replayed", obeys=False)
    recorded = robot.model_copy(
        update={"driver": driver, "settings": robot.settings.get("settings", {})}
    )
    return replace(load_vehicle(recorded, environment).capabilities, obeys=False)

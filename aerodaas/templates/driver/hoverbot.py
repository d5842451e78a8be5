"""A driver of your own: makes one kind of drone look like any other.

Every method returns at once; states and setpoints are ENU, metres and radians. This drone is a
point that moves as it is told. A driver of a real one talks to its SDK, keeps what it last heard,
and has no `advance_to`.
"""

import numpy as np

from aerodaas import Battery, Odometry
from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.messages.vehicle import (
    Capabilities,
    PositionSetpoint,
    Setpoint,
    VehicleMode,
    VehicleState,
)

NEAR = 0.05
"""Metres within which a place is reached."""
CLIMB = np.array([0.0, 0.0, 1.0])


class Hoverbot:
    """Named by the environment file's `driver`, as `hoverbot:Hoverbot`."""

    capabilities = Capabilities("hoverbot", returns_home=False)

    def __init__(self, robot: RobotConfig, environment: EnvironmentConfig) -> None:  # noqa: ARG002
        """Take the robot's settings from the environment file."""
        self.stamp, self.mode = 0, VehicleMode.GROUNDED
        self.position = np.array(robot.start, dtype=np.float64)
        self.velocity = np.zeros(3)
        self.goal: Setpoint = PositionSetpoint(self.position)

    def connect(self, timeout: float = 10.0) -> None:
        """Connect within `timeout` seconds; raise VehicleError that names the remedy."""

    def close(self) -> None:
        """Let go of the vehicle, which must stay safe on its own."""

    def preflight(self) -> list[str]:
        """Return the reasons to refuse a take-off."""
        return []

    def read(self) -> VehicleState:
        """Return the newest state."""
        odometry = Odometry(self.position.copy(), self.velocity.copy(), yaw=0.0)
        flying = self.mode is not VehicleMode.GROUNDED
        return VehicleState(self.stamp, odometry, Battery(1.0), self.mode, armed=flying)

    def send(self, setpoint: Setpoint, mode: VehicleMode = VehicleMode.GUIDED) -> Setpoint:
        """Send a setpoint and return it as it was sent, after clipping."""
        self.goal, self.mode = setpoint, mode
        return setpoint

    def take_off(self, height: float) -> None:
        """Climb to `height` metres above the ground."""
        self.send(PositionSetpoint(self.position + height * CLIMB), VehicleMode.TAKING_OFF)

    def hold(self) -> None:
        """Stop and stay."""
        self.send(PositionSetpoint(self.position.copy()), VehicleMode.HOLDING)

    def land(self) -> None:
        """Land here."""
        self.send(PositionSetpoint(self.position * (1 - CLIMB)), VehicleMode.LANDING)

    def return_home(self) -> None:
        """Return and land; this one cannot (`returns_home`), so the mission flies it home."""
        self.land()

    def advance_to(self, stamp: int) -> None:
        """Move on to mission time `stamp` (ns), as simulations do."""
        seconds, self.stamp = (stamp - self.stamp) / 1e9, stamp
        if isinstance(self.goal, PositionSetpoint):
            way = self.goal.position - self.position
            distance = float(np.linalg.norm(way))
            self.velocity = way * min(2.0, (self.goal.speed or 1.0) / (distance + 1e-9))
            self._arrive(distance)
        else:
            self.velocity = self.goal.velocity
        self.position = self.position + self.velocity * seconds

    def _arrive(self, distance: float) -> None:
        if distance < NEAR and self.mode is VehicleMode.LANDING:
            self.mode = VehicleMode.GROUNDED
        elif distance < NEAR and self.mode is VehicleMode.TAKING_OFF:
            self.mode = VehicleMode.HOLDING

"""A gimbal by the gimbal protocol v2: its manager is commanded, its device's attitude is heard.

Angles are converted here and nowhere else: MAVLink's are in degrees or a quaternion of FRD axes,
with yaw positive to the right.
"""

from __future__ import annotations

import math

import numpy as np

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import GimbalTarget
from aerodaas.geometry.frames import angles_of_rotation, wrap_angle
from aerodaas.messages.payload import GimbalAttitude

__all__ = ["MavlinkGimbal"]

_OURSELVES = -2.0
"""MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE: the sender gets primary control."""
_AS_IT_IS = -1.0
"""The same: secondary control stays with who has it."""
_LEVEL = mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
"""Roll and pitch keep to the horizon; without YAW_LOCK, yaw counts from the nose."""
_TO_NORTH = mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK | mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME
"""Flags of an attitude whose yaw counts from north."""
_TRACKING = 0.5
"""Seconds after a target within which another one tracks something: it is sent without an
acknowledgement, for the next one comes soon."""
_CONFIRMED = 2.0
"""Seconds after which a target is commanded all the same, so that a refusal is heard."""
_POLE = 5e-4
"""Within 1.8 degrees of straight down roll and yaw cannot be told apart in single precision."""
_UNIT = 0.1
"""Most by which the length of an attitude's quaternion may differ from one."""


class MavlinkGimbal:
    """One gimbal; implements `Gimbal`. The caller locks."""

    def __init__(self, information: Message, commander: Commander) -> None:
        """Command the gimbal of a GIMBAL_MANAGER_INFORMATION by `commander`."""
        self.fault = ""
        self.attitude: GimbalAttitude | None = None
        self.heard_at: float | None = None
        """Second of its newest attitude; None before the first."""
        self.device = int(information.gimbal_device_id)
        self._commander = commander
        self._pitch = _range(information.pitch_min, information.pitch_max, math.pi)
        right = _range(information.yaw_min, information.yaw_max, math.pi)
        self._yaw = (-right[1], -right[0])
        if information.cap_flags and not (
            information.cap_flags & mavlink.GIMBAL_MANAGER_CAP_FLAGS_HAS_YAW_AXIS
        ):
            self._yaw = (0.0, 0.0)
        self._ours = False
        self._aimed_at = self._commanded_at = -math.inf

    def silence(self, now: float) -> float:
        """Seconds since its newest attitude; 0 before the first, which it may never tell."""
        return 0.0 if self.heard_at is None else now - self.heard_at

    def aim(self, target: GimbalTarget, now: float) -> GimbalTarget:
        """Have it turn to `target`, as its range allows.

        Args:
            target: Pitch and yaw, radians.
            now: Monotonic clock, seconds.

        Returns:
            The target within the gimbal's range.

        Raises:
            VehicleError: If an angle is not finite.
        """
        if not (math.isfinite(target.pitch) and math.isfinite(target.yaw)):
            raise VehicleError(f"a gimbal needs finite angles, not {target}")
        pitch = min(max(target.pitch, self._pitch[0]), self._pitch[1])
        yaw = min(max(target.yaw, self._yaw[0]), self._yaw[1])
        tracks = now - self._aimed_at <= _TRACKING and now - self._commanded_at <= _CONFIRMED
        self._aimed_at = now
        if tracks and self._ours and not self.fault:
            self._commander.send(
                lambda *target: mavlink.MAVLink_gimbal_manager_set_pitchyaw_message(
                    *target, _LEVEL, self.device, pitch, -yaw, math.nan, math.nan
                )
            )
        else:
            self._command(pitch, yaw, now)
        return GimbalTarget(pitch, yaw)

    def _command(self, pitch: float, yaw: float, now: float) -> None:
        if not self._ours:
            self._take_control(now)
        self._commanded_at = now
        self._commander.give(
            PendingCommand(
                mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW,
                (
                    *(math.degrees(pitch), -math.degrees(yaw), math.nan, math.nan),
                    *(float(_LEVEL), 0.0, float(self.device)),
                ),
                "turn the gimbal",
            ),
            self._answered,
            now=now,
        )

    def _take_control(self, now: float) -> None:
        def done(outcome: CommandResult) -> None:
            self._ours = outcome.accepted

        self._commander.give(
            PendingCommand(
                mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE,
                (*(_OURSELVES, 0.0, _AS_IT_IS, _AS_IT_IS), 0.0, 0.0, float(self.device)),
                "take control of the gimbal",
            ),
            done,
            now=now,
        )

    def _answered(self, outcome: CommandResult) -> None:
        if outcome.replaced:
            return
        self.fault = "" if outcome.accepted else outcome.text
        # Somebody else may have taken it since.
        self._ours = self._ours and outcome.accepted

    def on_attitude(self, message: Message, now: float, stamp: int, heading: float) -> None:
        """Process a GIMBAL_DEVICE_ATTITUDE_STATUS.

        What is no attitude, or another gimbal's, is ignored; it was not heard then.

        Args:
            message: The message.
            now: Monotonic clock, seconds.
            stamp: Mission clock at which it was heard, nanoseconds.
            heading: The vehicle's, radians clockwise from north.
        """
        if message.gimbal_device_id not in {0, self.device}:
            return
        rotation = _rotation(message.q)
        if rotation is None:
            self.fault = "it tells an attitude that is none"
            return
        roll, pitch, right = angles_of_rotation(rotation, _POLE)
        if message.flags & _TO_NORTH and not (
            message.flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
        ):
            right -= heading
        self.heard_at = now
        self.attitude = GimbalAttitude(stamp, pitch, wrap_angle(-right), roll)


def _range(low: float, high: float, widest: float) -> tuple[float, float]:
    """A range of angles; all of them where none is told."""
    if not (math.isfinite(low) and math.isfinite(high)) or low >= high:
        return -widest, widest
    return float(low), float(high)


def _rotation(quaternion: list[float]) -> np.ndarray | None:
    """The matrix of a quaternion (w, x, y, z); None for what is no rotation."""
    length = math.sqrt(math.fsum(part * part for part in quaternion))
    if not abs(length - 1.0) <= _UNIT:
        return None
    w, x, y, z = (part / length for part in quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )

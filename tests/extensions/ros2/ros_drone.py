"""A drone on ROS 2 topics, as Gazebo's multicopter control with ros_gz_bridge has them.

It takes `cmd_vel` (Twist in the body's tilted axes) and `enable` (Bool) and publishes `odometry`,
`battery` and `image`, all under its prefix; the flight is the embedded simulator's.
"""

from __future__ import annotations

import math
import threading
import time
from types import TracebackType
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from typing_extensions import Self

from aerodaas.extensions.ros2.topics import types
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.airframe import Airframe, Wind
from aerodaas.simulation.dynamics import STEP, KinematicState, Multirotor

__all__ = ["RosDrone", "odometry_message"]

_STEPS = 2
"""Steps of the simulator between odometry messages: 50 Hz."""


def odometry_message(motion: KinematicState, stamp: int) -> Any:  # noqa: ANN401 - a type made at run time
    """Of a state of motion; the twist is in the body's axes."""
    attitude = rotation_from_rpy(motion.roll, motion.pitch, motion.yaw)
    message = types.ros_message(types.ODOMETRY, child_frame_id="x3/base_footprint")
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
    message.header.frame_id = "x3/odom"
    pose, twist = message.pose.pose, message.twist.twist
    quaternion = Rotation.from_euler("ZYX", [motion.yaw, motion.pitch, motion.roll]).as_quat()
    for target, values in (
        (pose.position, motion.position),
        (pose.orientation, quaternion),
        (twist.linear, attitude.T @ np.array(motion.velocity)),
        (twist.angular, attitude.T @ np.array([0.0, 0.0, motion.yaw_rate])),
    ):
        for axis, value in zip("xyzw", values, strict=False):
            setattr(target, axis, float(value))
    return message


class RosDrone:
    """The drone, from `with` to its end."""

    def __init__(
        self,
        link: RosLink,
        prefix: str,
        *,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        yaw: float = 0.0,
        simulated_time: bool = True,
    ) -> None:
        """Stand at `start` (ENU metres), heading `yaw` (radians)."""
        wind = Wind((1.0, -0.5, 0.0), 0.2, "ros", STEP)
        self._rotor = Multirotor(
            Airframe(), wind, max_acceleration=4.0, max_yaw_rate=2.0, start=start, yaw=yaw
        )
        self._simulated = simulated_time
        self._odometry = link.publisher(f"{prefix}/odometry", types.ODOMETRY)
        self._battery = link.publisher(f"{prefix}/battery", types.BATTERY)
        link.subscribe(f"{prefix}/cmd_vel", types.TWIST, self._take)
        link.subscribe(f"{prefix}/enable", types.BOOL, self._switch)
        self._lock = threading.Lock()
        self._twist = types.ros_message(types.TWIST)
        self.enabled = False
        self.heard: list[Any] = []
        """All velocities, as they came."""
        self.switched: list[bool] = []
        """Every `enable`."""
        self.silent = False
        """Set it to publish no odometry."""
        self.spoiled = False
        """Set it to publish odometry of NaN."""
        self.charge = 0.8
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def motion(self) -> KinematicState:
        """Exact state of motion."""
        with self._lock:
            return self._rotor.motion()

    @property
    def velocity(self) -> Any:  # noqa: ANN401
        """The linear velocity that it heard last."""
        with self._lock:
            return self._twist.linear

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stopping.set()
        self._thread.join()

    def _take(self, message: Any) -> None:  # noqa: ANN401
        with self._lock:
            self._twist = message
            self.heard.append(message)

    def _switch(self, message: Any) -> None:  # noqa: ANN401
        with self._lock:
            self.enabled = message.data
            self.switched.append(message.data)

    def _run(self) -> None:
        began, steps = time.monotonic(), 0
        while not self._stopping.wait(STEP):
            due = int((time.monotonic() - began) / STEP)
            while steps < due:
                self._step()
                steps += 1
                if steps % _STEPS == 0:
                    self._tell(steps)

    def _step(self) -> None:
        with self._lock:
            motion, asked = self._rotor.motion(), self._twist
            attitude = rotation_from_rpy(motion.roll, motion.pitch, motion.yaw)
            linear = asked.linear
            x, y, z = map(float, attitude @ np.array([linear.x, linear.y, linear.z]))
            resting = self._rotor.on_ground and z <= 0.0
            self._rotor.step((x, y, z) if self.enabled and not resting else None, asked.angular.z)

    def _tell(self, steps: int) -> None:
        stamp = round(steps * STEP * 1e9) if self._simulated else time.time_ns()
        message = odometry_message(self.motion, stamp)
        if self.spoiled:
            message.pose.pose.position.x = math.nan
        if not self.silent:
            self._odometry.publish(message)
        if steps % 50 == 0:
            self._battery.publish(
                types.ros_message(types.BATTERY, voltage=15.2, percentage=self.charge)
            )

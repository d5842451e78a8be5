"""A drone on ROS 2 topics, as Gazebo's multicopter control with ros_gz_bridge has them.

It takes `cmd_vel` (Twist in the body's tilted axes) and `enable` (Bool) and publishes `odometry`,
`battery` and `image`, all under its prefix; the flight is the embedded simulator's.
"""

from __future__ import annotations

import math
import threading
import time
from types import TracebackType

import numpy as np
from typing_extensions import Self

from aerodaas.extensions.ros2.topics import messages as ros
from aerodaas.extensions.ros2.topics.link import RosLink
from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.airframe import Airframe, Wind
from aerodaas.simulation.dynamics import STEP, KinematicState, Multirotor

__all__ = ["RosDrone", "odometry_message", "quaternion"]

_STEPS = 2
"""Steps of the simulator between odometry messages: 50 Hz."""


def quaternion(roll: float, pitch: float, yaw: float) -> ros.Quaternion:
    """By z-y-x angles in radians, written out as textbooks have it."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return ros.Quaternion(
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


def odometry_message(motion: KinematicState, stamp: int) -> ros.Odometry:
    """Of a state of motion; the twist is in the body's axes."""
    attitude = rotation_from_rpy(motion.roll, motion.pitch, motion.yaw)
    linear = attitude.T @ np.array(motion.velocity)
    angular = attitude.T @ np.array([0.0, 0.0, motion.yaw_rate])
    pose = ros.Pose(ros.Point(*motion.position), quaternion(motion.roll, motion.pitch, motion.yaw))
    twist = ros.Twist(ros.Vector3(*map(float, linear)), ros.Vector3(*map(float, angular)))
    return ros.Odometry(
        ros.Header(ros.Time(*divmod(stamp, 1_000_000_000)), "x3/odom"),
        "x3/base_footprint",
        ros.PoseWithCovariance(pose),
        ros.TwistWithCovariance(twist),
    )


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
        self._odometry = link.publisher(f"{prefix}/odometry", ros.Odometry)
        self._battery = link.publisher(f"{prefix}/battery", ros.BatteryState)
        link.subscribe(f"{prefix}/cmd_vel", ros.Twist, self._take)
        link.subscribe(f"{prefix}/enable", ros.Bool, self._switch)
        self._lock = threading.Lock()
        self._twist = ros.Twist()
        self.enabled = False
        self.heard: list[ros.Twist] = []
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
    def velocity(self) -> ros.Vector3:
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

    def _take(self, message: ros.Twist) -> None:
        with self._lock:
            self._twist = message
            self.heard.append(message)

    def _switch(self, message: ros.Bool) -> None:
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
            self._battery.publish(ros.BatteryState(voltage=15.2, percentage=self.charge))

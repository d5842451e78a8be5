"""Gimbal and camera of a simulated drone, in its own steps of time.

The camera takes no pixels: a picture is rendered by whoever keeps it, from what the `Photo` says of
the moment of its exposure. So the drone's loop never waits for a renderer, and a picture does not
depend on how fast the machine is.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from aerodaas.cameras.settings import camera_settings
from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import CameraConfig, EnvironmentConfig, GimbalConfig, RobotConfig
from aerodaas.config.sections.robot import SIMULATED_INTERVAL
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import GimbalTarget, LensTarget, PhotoOutcome
from aerodaas.messages.payload import GimbalAttitude, Photo, PhotoPlace
from aerodaas.messages.vehicle import VehicleState
from aerodaas.simulation.equipment import SimulatedEquipment

__all__ = ["SimulatedPayload"]


class SimulatedPayload(SimulatedEquipment):
    """A drone's first simulated camera, and the gimbal that it hangs from; a `Payload`."""

    def __init__(
        self, robot: RobotConfig, environment: EnvironmentConfig, descend: Callable[[], None]
    ) -> None:
        """Carry what `robot` has."""
        super().__init__(robot, environment, descend)
        self.photo_camera: SimulatedPhotoCamera | None = None
        """None without a simulated camera."""
        self.gimbal: SimulatedGimbal | None = None
        """None if the camera is bolted to the body."""
        for sensor in robot.sensors:
            if sensor.type == "camera" and environment.camera_driver(sensor) == "simulated":
                settings = camera_settings(sensor)
                self.photo_camera = SimulatedPhotoCamera(settings)
                if settings.gimbal is not None:
                    self.gimbal = SimulatedGimbal(settings.gimbal, settings)
                break

    @property
    def awaits_state(self) -> bool:
        """Whether a picture is to be exposed."""
        return self.photo_camera is not None and self.photo_camera.waits

    def on_state(self, state: VehicleState) -> None:
        """Expose the picture."""
        if self.photo_camera is not None:
            self.photo_camera.expose(state)

    def advance_to(self, stamp: int) -> None:
        """Turn the gimbal, and store pictures."""
        if self.gimbal is not None:
            self.gimbal.advance_to(stamp)
        if self.photo_camera is not None:
            self.photo_camera.advance_to(stamp)

    def complete(self, state: VehicleState) -> VehicleState:
        """Add where the gimbal looks, and the zoom."""
        attitude = None if self.gimbal is None else self.gimbal.attitude
        zoom = None if self.photo_camera is None else self.photo_camera.zoom
        return state if attitude is zoom is None else replace(state, gimbal=attitude, zoom=zoom)


class SimulatedGimbal:
    """A gimbal that turns at a limited rate; implements `Gimbal`."""

    fault = ""

    def __init__(self, settings: GimbalConfig, camera: CameraConfig) -> None:
        """Look as `camera` is mounted."""
        self._step = math.radians(settings.max_rate)
        self._lowest, self._highest = map(math.radians, (settings.lowest, settings.highest))
        self._widest = math.radians(settings.widest)
        self._stamp = 0
        self._pitch, self._yaw = -math.radians(camera.pitch), math.radians(camera.yaw)
        self._target = GimbalTarget(self._pitch, self._yaw)

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """Turn to `target` from now on; returns it as it is within the range."""
        pitch = min(max(target.pitch, self._lowest), self._highest)
        yaw = min(max(target.yaw, -self._widest), self._widest)
        self._target = GimbalTarget(pitch, yaw)
        return self._target

    @property
    def attitude(self) -> GimbalAttitude:
        """Where it looks."""
        return GimbalAttitude(self._stamp, self._pitch, self._yaw)

    def advance_to(self, stamp: int) -> None:
        """Turn until mission time `stamp`, nanoseconds."""
        most = self._step * (stamp - self._stamp) / NANOSECONDS
        self._stamp = stamp
        self._pitch += min(max(self._target.pitch - self._pitch, -most), most)
        self._yaw += min(max(self._target.yaw - self._yaw, -most), most)


class SimulatedPhotoCamera:
    """A camera on board; implements `LensCamera` and `VideoCamera`."""

    def __init__(self, settings: CameraConfig) -> None:
        """Have taken nothing yet."""
        interval = (
            SIMULATED_INTERVAL if settings.photo_interval is None else settings.photo_interval
        )
        self._storing_time = round(interval * NANOSECONDS)
        """Nanoseconds from exposure until the camera says that it has the picture."""
        self.zoom: float | None = 0.0 if settings.zoom > 1.0 else None
        """Percent; None for a lens without."""
        self.adjusted = True
        self.lens_fault = self.film_fault = ""
        self.filming = False
        """Whether it records. Its frames are the video stream's; no other file is written."""
        self._taken = 0
        self._asked: list[tuple[int, str]] = []
        self._storing: list[Photo] = []
        self._now = 0

    def take_photo(self, label: str) -> int:
        """Take a picture at the next step of time."""
        self._taken += 1
        self._asked.append((self._taken, label))
        return self._taken

    def adjust(self, target: LensTarget) -> None:
        """Zoom at once; everything is in focus to it. Raises VehicleError without a zoom."""
        if target.zoom is None:
            return
        if self.zoom is None:
            raise VehicleError("the camera has no zoom")
        self.zoom = target.zoom

    def film(self, on: bool) -> None:  # noqa: FBT001 - it is all that is said
        """Record from now on, or no more."""
        self.filming = on

    def outcomes(self) -> list[PhotoOutcome]:
        """Pictures that are stored by now."""
        ready = [one for one in self._storing if one.stamp + self._storing_time <= self._now]
        self._storing = [one for one in self._storing if one not in ready]
        return list(ready)

    @property
    def waits(self) -> bool:
        """Whether a picture is to be exposed."""
        return bool(self._asked)

    def advance_to(self, stamp: int) -> None:
        """Let time pass until `stamp`, nanoseconds."""
        self._now = stamp

    def expose(self, state: VehicleState) -> None:
        """Take what was asked for, from where the vehicle is now."""
        fix = state.gps
        place = None if fix is None else PhotoPlace(fix.latitude, fix.longitude, fix.altitude)
        self._storing += [
            Photo(
                number,
                state.stamp,
                label,
                place,
                state.odometry,
                state.gimbal,
                state.truth,
                zoom=state.zoom,
            )
            for number, label in self._asked
        ]
        self._asked.clear()

"""What a vehicle carries: gimbals and cameras, the autopilot's and those with ids of their own.

They are asked for after connecting, and again in flight until they answer or refuse; nothing waits
for them.
"""

from __future__ import annotations

import itertools
import logging
import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

from aerodaas.drivers.mavlink.component import ComponentContext, MavlinkComponent, MessageHandler
from aerodaas.drivers.mavlink.connecting import Connection
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.payload.equipment import (
    Gimbal,
    GimbalTarget,
    LensTarget,
    PhotoCamera,
    PhotoOutcome,
)
from aerodaas.extensions.payload.mavlink.camera import MavlinkCamera
from aerodaas.extensions.payload.mavlink.camera_status import VideoStream
from aerodaas.extensions.payload.mavlink.components import CAMERAS, GIMBALS, PayloadComponent
from aerodaas.extensions.payload.mavlink.gimbal import MavlinkGimbal
from aerodaas.geometry.frames import yaw_enu_to_ned
from aerodaas.messages.health import HealthReadings
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import CameraStatus, GimbalAttitude
from aerodaas.messages.vehicle import VehicleState

__all__ = ["MavlinkPayload"]

_log = logging.getLogger(__name__)

_MESSAGES = (
    *("GIMBAL_MANAGER_INFORMATION", "GIMBAL_DEVICE_ATTITUDE_STATUS"),
    *("CAMERA_INFORMATION", "CAMERA_IMAGE_CAPTURED", "CAMERA_FEEDBACK"),
    *("VIDEO_STREAM_INFORMATION", "STORAGE_INFORMATION", "CAMERA_CAPTURE_STATUS"),
)
"""Of gimbals and cameras, whoever sends them."""
_PARTING = 2.0
"""Seconds that a recording that is to end is awaited for before the link is closed."""


class MavlinkPayload(MavlinkComponent):
    """Gimbals and cameras of one vehicle, of which one of each is used.

    One with an id of its own comes before the autopilot's, and of several the one with the lowest
    id: the choice depends on what is there, and not on who answered first.
    """

    component_ids = CAMERAS | GIMBALS

    def __init__(self, context: ComponentContext) -> None:
        """Know of nothing yet."""
        super().__init__(context)
        self._lock = context.lock
        self._autopilot: PayloadComponent | None = None
        self._own: dict[int, PayloadComponent] = {}
        """Those with an id of their own."""
        self._odometry: Odometry | None = None
        self._count = itertools.count(1)
        """Numbers of pictures, over all cameras."""
        self._filmed: PayloadComponent | None = None
        """Whose recording was begun or ended last."""

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """Handlers of the messages by which the autopilot tells of its gimbal and its camera."""
        return dict.fromkeys(_MESSAGES, self._on_autopilot_message)

    def connect(self, connection: Connection) -> None:
        """Begin to search, first by what the autopilot itself manages."""
        super().connect(connection)
        self._autopilot = self._component(connection.commander, own=False)

    def _component(self, commander: Commander, *, own: bool) -> PayloadComponent:
        return PayloadComponent(
            commander.component, commander, moment=self._moment, count=self._count, own=own
        )

    def _ranked(self) -> list[PayloadComponent]:
        """All components, the preferred ones first."""
        own = [self._own[number] for number in sorted(self._own)]
        return own if self._autopilot is None else [*own, self._autopilot]

    def _gimbal(self, now: float) -> MavlinkGimbal | None:
        found = (one.gimbal_now(now) for one in self._ranked())
        return next((one for one in found if one is not None), None)

    @property
    def gimbal(self) -> Gimbal | None:
        """The gimbal; None before one is found, and while none says anything any more."""
        with self._lock:
            gimbal = self._gimbal(time.monotonic())
            return None if gimbal is None else _LockedGimbal(gimbal, self._lock)

    @property
    def photo_camera(self) -> PhotoCamera | None:
        """The camera; None before one is found, and while none says anything any more."""
        with self._lock:
            tells = any(
                one.camera is not None and one.camera.has_outcomes for one in self._ranked()
            )
            known = tells or self.used_camera() is not None
            return _Cameras(self, self._lock) if known else None

    def used_camera(self) -> MavlinkCamera | None:
        """The camera that takes the next picture; the caller locks."""
        found = (one.camera_now(time.monotonic()) for one in self._ranked())
        return next((one for one in found if one is not None), None)

    def film(self, now: float, *, on: bool) -> None:
        """Have the camera record that takes pictures, or that end which was told; locked.

        Args:
            now: Monotonic clock, seconds.
            on: Whether to record.

        Raises:
            VehicleError: If no camera answers any more, or it cannot record.
        """
        if on or self._filmed is None:
            self._filmed = next((one for one in self._ranked() if one.camera_now(now)), None)
        camera = self.filming_camera(now)
        if camera is None:
            raise VehicleError("no camera answers any more")
        camera.recorder.film(now, on=on)

    def filming_camera(self, now: float) -> MavlinkCamera | None:
        """The camera that was told to record or to end, while it answers; the caller locks.

        Before, the one that takes pictures.
        """
        return self.used_camera() if self._filmed is None else self._filmed.camera_now(now)

    def close(self, pause: Callable[[], None]) -> None:
        """Wait a little for a recording that is to end."""
        end = time.monotonic() + _PARTING
        while any(one.camera is not None and one.camera.recorder.ending for one in self._ranked()):
            if time.monotonic() >= end:
                name = self.context.robot.id
                _log.warning("%s: its camera has not acknowledged that its video is to end", name)
                return
            pause()

    def outcomes(self) -> list[PhotoOutcome]:
        """Outcomes of pictures of all cameras; the caller locks."""
        cameras = [one.camera for one in self._ranked() if one.camera is not None]
        return [outcome for camera in cameras for outcome in camera.outcomes()]

    def complete_health(self, readings: HealthReadings, now: float) -> HealthReadings:
        """Add the cameras."""
        del now
        return replace(readings, cameras=tuple(self.cameras()))

    def description(self) -> list[str]:
        """The streams of video, and each camera."""
        cameras = self.cameras()
        return [f"video of {camera}: {stream}" for camera, stream in self.streams()] + [
            f"{one.name}: {one}{f'; {one.trouble}' if one.trouble else ''}" for one in cameras
        ]

    def complete(self, state: VehicleState, now: float, placed_at: float) -> VehicleState:
        """Add the gimbal's attitude and what is wrong; the state is the newest from now on."""
        del placed_at
        self._odometry = state.odometry
        faults = [
            f"{one.name}: no word from it any more" for one in self._own.values() if one.gone(now)
        ]
        faults += [
            f"{one.name}: {one.status.trouble}"
            for one in self._ranked()
            if one.status is not None and one.status.trouble and not one.gone(now)
        ]
        attitude, video = self._attitude(now), self._video()
        if attitude is None and not faults and not video:
            return state
        return replace(state, gimbal=attitude, faults=(*state.faults, *faults), video=video)

    def streams(self) -> list[tuple[str, VideoStream]]:
        """Video that its cameras tell of, with the camera's name, the preferred one first."""
        with self._lock:
            return [
                (one.name, one.streams[number])
                for one in self._ranked()
                for number in sorted(one.streams)
            ]

    def cameras(self) -> list[CameraStatus]:
        """Status of each camera, the preferred one first."""
        with self._lock:
            told = (one.status for one in self._ranked())
            return [status for status in told if status is not None]

    def _video(self) -> str:
        return next((stream.uri for _, stream in self.streams() if not stream.objection), "")

    def _attitude(self, now: float) -> GimbalAttitude | None:
        """The newest word of the gimbal that is used, or was last."""
        gimbal = self._gimbal(now)
        if gimbal is None:
            gimbal = next((one.gimbal for one in self._ranked() if one.gimbal is not None), None)
        return None if gimbal is None else gimbal.attitude

    def _moment(self) -> tuple[int, Odometry | None, GimbalAttitude | None]:
        return self.context.now(), self._odometry, self._attitude(time.monotonic())

    def _on_autopilot_message(self, message: Message, now: float) -> None:
        if self._autopilot is not None:
            self._process(self._autopilot, message, now)

    def on_component_message(self, message: Message, now: float) -> None:
        """Process what a camera or a gimbal with an id of its own says."""
        if self._autopilot is None:
            return
        number = message.get_srcComponent()
        if number not in self._own:
            if message.get_type() not in {"HEARTBEAT", *_MESSAGES}:
                return
            commander = self._autopilot.commander.to(number)
            self._own[number] = self._component(commander, own=True)
        self._process(self._own[number], message, now)

    def _process(self, component: PayloadComponent, message: Message, now: float) -> None:
        component.on_message(message, now)
        if message.get_type() != "GIMBAL_DEVICE_ATTITUDE_STATUS":
            return
        yaw = math.nan if self._odometry is None else self._odometry.yaw
        heading = yaw_enu_to_ned(yaw) if math.isfinite(yaw) else 0.0
        for one in self._ranked():
            # A device speaks for itself, or whoever manages it speaks for it.
            if one.gimbal is not None and component.number in {one.number, one.gimbal.device}:
                one.gimbal.on_attitude(message, now, self.context.now(), heading)

    def step(self, now: float) -> None:
        """Search on, and see to the gimbals' attitudes."""
        for one in self._ranked():
            one.step(now)
            one.see_to_attitude(now, self._commander_of)

    def _commander_of(self, device: int) -> Commander | None:
        component = self._own.get(device)
        return None if component is None else component.commander


class _LockedGimbal:
    """A gimbal for the loop's thread."""

    def __init__(self, gimbal: MavlinkGimbal, lock: AbstractContextManager[object]) -> None:
        self._gimbal = gimbal
        self._lock = lock

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """See `Gimbal`."""
        with self._lock:
            return self._gimbal.aim(target, time.monotonic())

    @property
    def attitude(self) -> GimbalAttitude | None:
        """See `Gimbal`."""
        return self._gimbal.attitude

    @property
    def fault(self) -> str:
        """See `Gimbal`."""
        return self._gimbal.fault


class _Cameras:
    """All cameras for the loop's thread: one takes pictures, all tell what became of theirs."""

    def __init__(self, payload: MavlinkPayload, lock: AbstractContextManager[object]) -> None:
        self._payload = payload
        self._lock = lock

    @contextmanager
    def _used(self) -> Iterator[MavlinkCamera]:
        with self._lock:
            camera = self._payload.used_camera()
            if camera is None:
                raise VehicleError("no camera answers any more")
            yield camera

    def take_photo(self, label: str) -> int:
        """See `PhotoCamera`."""
        with self._used() as camera:
            return camera.take_photo(label, time.monotonic())

    def adjust(self, target: LensTarget) -> None:
        """See `LensCamera`."""
        with self._used() as camera:
            camera.lens.adjust(target, time.monotonic())

    @property
    def adjusted(self) -> bool:
        """See `LensCamera`."""
        with self._lock:
            camera = self._payload.used_camera()
            return camera is not None and camera.lens.adjusted

    @property
    def lens_fault(self) -> str:
        """See `LensCamera`."""
        with self._lock:
            camera = self._payload.used_camera()
            return "" if camera is None else camera.lens.fault

    def film(self, on: bool) -> None:  # noqa: FBT001 - it is all that is said
        """See `VideoCamera`."""
        with self._lock:
            self._payload.film(time.monotonic(), on=on)

    @property
    def filming(self) -> bool | None:
        """See `VideoCamera`."""
        with self._lock:
            camera = self._payload.filming_camera(time.monotonic())
            return None if camera is None else camera.recorder.filming

    @property
    def film_fault(self) -> str:
        """See `VideoCamera`."""
        with self._lock:
            camera = self._payload.filming_camera(time.monotonic())
            return "" if camera is None else camera.recorder.fault

    def outcomes(self) -> list[PhotoOutcome]:
        """See `PhotoCamera`."""
        with self._lock:
            return self._payload.outcomes()

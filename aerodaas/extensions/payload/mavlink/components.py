"""Components with MAVLink ids of their own: cameras and gimbals, each found, asked and lost alone.

The link hands on only what comes from the vehicle's own system and address. What a component does
not do costs what was asked of it, and nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.extensions.payload.mavlink.camera import (
    MavlinkCamera,
    MavlinkLens,
    MavlinkRecorder,
    Moment,
)
from aerodaas.extensions.payload.mavlink.camera_status import (
    VideoStream,
    video_stream,
    with_capture,
    with_card,
    with_model,
)
from aerodaas.extensions.payload.mavlink.gimbal import MavlinkGimbal
from aerodaas.messages.payload import CameraStatus

__all__ = ["CAMERAS", "GIMBALS", "PayloadComponent"]

CAMERAS = frozenset(range(100, 106))
"""Component ids of cameras (MAV_COMP_ID_CAMERA to CAMERA6)."""
GIMBALS = frozenset({154, *range(171, 176)})
"""Component ids of gimbals (MAV_COMP_ID_GIMBAL to GIMBAL6)."""

_CAMERA = mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION
_VIDEO = mavlink.MAVLINK_MSG_ID_VIDEO_STREAM_INFORMATION
_STORAGE = mavlink.MAVLINK_MSG_ID_STORAGE_INFORMATION
_CAPTURE = mavlink.MAVLINK_MSG_ID_CAMERA_CAPTURE_STATUS
_BEFORE: Mapping[int, tuple[int, tuple[float, ...]]] = {
    _CAMERA: (mavlink.MAV_CMD_REQUEST_CAMERA_INFORMATION, (1.0,)),
    _VIDEO: (mavlink.MAV_CMD_REQUEST_VIDEO_STREAM_INFORMATION, ()),
    _STORAGE: (mavlink.MAV_CMD_REQUEST_STORAGE_INFORMATION, (0.0, 1.0)),
    _CAPTURE: (mavlink.MAV_CMD_REQUEST_CAMERA_CAPTURE_STATUS, (1.0,)),
}
"""How cameras were asked before MAV_CMD_REQUEST_MESSAGE: by commands that are deprecated and that
cameras still want (MAVSDK's camera server tells of its card by them only)."""
_CARD_AGAIN = 20.0
"""Seconds after which a camera that tells of its card is asked again."""
_CAPTURE_AGAIN = 10.0
"""The same, of what it does."""
_CAPTURE_SOON = 1.0
"""The same, while it does not tell of a picture that is overdue, or has just begun or ended a
recording."""
_MOST_STREAMS = 8
"""Streams of one camera that are remembered."""
_VALUES = 7
"""Of each command."""
_PAUSE = 2.0
"""Seconds between two requests for the same message."""
_REQUESTS = 5
"""Requests for a message that is promised and does not come."""
_RATE = 10.0
"""Attitudes of the gimbal a second."""
_OVERDUE = 3.0
"""Seconds without an attitude after which it is asked for again."""
_GONE = 5.0
"""Seconds without a word after which a component, or a gimbal's attitude, counts as gone."""


@dataclass(slots=True)
class _Search:
    """How far the search for one message is."""

    message: int
    left: int = _REQUESTS
    due: float = -math.inf
    before: bool = False
    """Whether it is asked for as in former days, since it was refused otherwise."""

    def command(self) -> PendingCommand:
        """Command that requests the message."""
        now = mavlink.MAV_CMD_REQUEST_MESSAGE, (float(self.message),)
        number, values = _BEFORE[self.message] if self.before else now
        padded = (*values, *[0.0] * (_VALUES - len(values)))
        return PendingCommand(number, padded, "tell what it carries", insists=False)

    def refused(self) -> None:
        """Ask in the other way, or no more."""
        if self.before or self.message not in _BEFORE:
            self.left = 0
        else:
            self.before, self.left, self.due = True, _REQUESTS, -math.inf


class PayloadComponent:
    """Camera or gimbal of one MAVLink id, or what the autopilot itself manages; the caller locks.

    The link's thread calls `take` and `turn`.
    """

    def __init__(
        self,
        number: int,
        commander: Commander,
        *,
        moment: Moment,
        count: Iterator[int],
        own: bool,
    ) -> None:
        """Search for what component `number` is, by `commander`.

        `moment` and `count` are a camera's. `own` is whether the id is its own, and so are its
        heartbeats and its commander's turns.
        """
        self.number = number
        self.gimbal: MavlinkGimbal | None = None
        self.camera: MavlinkCamera | None = None
        self.streams: dict[int, VideoStream] = {}
        """Of its video, by number; the first word of each counts."""
        self.status: CameraStatus | None = None
        """Of its camera; None until it is known, and without a camera."""
        self._card_at = self._capture_at = -math.inf
        self.commander = commander
        self._moment = moment
        self._count = count
        self._own = own
        self._heard_at: float | None = None
        self._asked_at = -math.inf
        self._begin()

    def _begin(self) -> None:
        gimbals = [mavlink.MAVLINK_MSG_ID_GIMBAL_MANAGER_INFORMATION]
        cameras = [mavlink.MAVLINK_MSG_ID_CAMERA_INFORMATION]
        wanted = gimbals + cameras
        if self._own:
            wanted = cameras if self.number in CAMERAS else gimbals
        self._searches = [_Search(one) for one in wanted]
        self._informed = False

    @property
    def name(self) -> str:
        """Name of the component in texts for people."""
        if not self._own:
            return "the autopilot's camera"
        return f"{'camera' if self.number in CAMERAS else 'gimbal'} (component {self.number})"

    def silent(self, now: float) -> float:
        """Seconds since a component of its own was heard; 0 for the autopilot, heard otherwise."""
        return 0.0 if self._heard_at is None else now - self._heard_at

    def gone(self, now: float) -> bool:
        """Whether it has fallen silent."""
        return self.silent(now) > _GONE

    def gimbal_now(self, now: float) -> MavlinkGimbal | None:
        """Its gimbal; None without one, or while that says nothing any more."""
        gimbal = self.gimbal
        silent = gimbal is None or gimbal.silence(now) > _GONE or self.gone(now)
        return None if silent else gimbal

    def camera_now(self, now: float) -> MavlinkCamera | None:
        """Its camera; None without one, or while it says nothing any more."""
        return None if self.gone(now) else self.camera

    def on_message(self, message: Message, now: float) -> None:
        """Process a message of its own, other than an attitude.

        Args:
            message: The message.
            now: Monotonic clock, seconds.
        """
        if self._own:
            if self.gone(now):
                self._begin()
            self._heard_at = now
        kind = message.get_type()
        if kind == "COMMAND_ACK":
            if self._own:
                self.commander.on_ack(message, now)
        elif kind in {"CAMERA_IMAGE_CAPTURED", "CAMERA_FEEDBACK"}:
            if self.camera is not None:
                self.camera.on_message(message)
        else:
            self._on_information(message, kind, now)

    def _on_information(self, message: Message, kind: str, now: float) -> None:
        """Process information that was searched for."""
        if kind == "GIMBAL_MANAGER_INFORMATION":
            self.gimbal = self.gimbal or MavlinkGimbal(message, self.commander)
        elif kind == "CAMERA_INFORMATION":
            self._inform(message)
        elif kind == "VIDEO_STREAM_INFORMATION" and len(self.streams) < _MOST_STREAMS:
            self.streams.setdefault(int(message.stream_id), video_stream(message))
        elif self.status is None:
            return
        elif kind == "STORAGE_INFORMATION":
            self.status, self._card_at = with_card(self.status, message), now
            self._answered(_STORAGE)
        elif kind == "CAMERA_CAPTURE_STATUS":
            self.status, self._capture_at = with_capture(self.status, message), now
            self._answered(_CAPTURE)
            if self.camera is not None:
                self.camera.compare(self.status, now)
                self.camera.recorder.heed(self.status, now)

    def _answered(self, message: int) -> None:
        """Ask for it again later: it changes."""
        for search in self._searches:
            search.left = _REQUESTS if search.message == message else search.left

    def _inform(self, information: Message) -> None:
        self._informed, flags = True, int(information.flags)
        self.status = with_model(self.status or CameraStatus(self.name), information)
        if self.camera is None and _takes_pictures(information):
            lens = MavlinkLens(self.commander, flags)
            recorder = MavlinkRecorder(self.commander, flags)
            self.camera = MavlinkCamera(self.commander, lens, recorder, self._moment, self._count)
        films = flags & mavlink.CAMERA_CAP_FLAGS_HAS_VIDEO_STREAM
        wanted = [_STORAGE, _CAPTURE] if self.camera is not None else []
        for message in [*wanted, _VIDEO] if films else wanted:
            if all(search.message != message for search in self._searches):
                self._searches.append(_Search(message))

    def _knows(self, message: int, now: float) -> bool:
        """Whether what a search is for has been found."""
        if message == _STORAGE:
            return now - self._card_at < _CARD_AGAIN
        if message == _CAPTURE:
            camera = self.camera
            soon = camera is not None and (camera.is_overdue(now) or camera.recorder.unconfirmed)
            return now - self._capture_at < (_CAPTURE_SOON if soon else _CAPTURE_AGAIN)
        if message == _VIDEO:
            return bool(self.streams)
        return self._informed if message == _CAMERA else self.gimbal is not None

    def step(self, now: float) -> None:
        """Repeat commands, search on, and give up what does not come."""
        if self._own:
            if self.gone(now):
                if self.camera is not None:
                    self.camera.give_up("the camera says nothing any more")
                    self.camera.recorder.give_up()
                return
            self.commander.step(now)
        if self.camera is not None:
            self.camera.step(now)
        for search in self._searches:
            if (
                not self._knows(search.message, now)
                and search.left
                and now >= search.due
                and self.commander.under_way(search.command().number) is None
            ):
                self._request(search, now)
                return

    def _request(self, search: _Search, now: float) -> None:
        search.left -= 1
        search.due = now + _PAUSE

        def done(outcome: CommandResult) -> None:
            if not (outcome.accepted or outcome.replaced) and outcome.text != "no answer":
                search.refused()

        self.commander.give(search.command(), done, now=now)

    def see_to_attitude(self, now: float, device: Callable[[int], Commander | None]) -> None:
        """Ask for the gimbal's attitude, at first and where it does not come.

        Args:
            now: Monotonic clock, seconds.
            device: Commander of a gimbal device that speaks for itself, by its id.
        """
        gimbal = self.gimbal
        if gimbal is None or self.gone(now) or now - self._asked_at < _OVERDUE:
            return
        commander = device(gimbal.device) or self.commander
        number = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        missing = gimbal.heard_at is None or gimbal.silence(now) > _OVERDUE
        # An autopilot takes one such command at a time, and the flight's own come first.
        first = self._asked_at == -math.inf
        if not (missing or first) or commander.under_way(number) is not None:
            return
        self._asked_at = now
        message = float(mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS)
        commander.give(
            PendingCommand(
                number, (message, 1e6 / _RATE, *[0.0] * 5), "tell where the gimbal looks"
            ),
            now=now,
        )


def _takes_pictures(information: Message) -> bool:
    """Whether a camera says so; one without any capability is an old one that takes pictures."""
    flags = int(information.flags)
    return not flags or bool(flags & mavlink.CAMERA_CAP_FLAGS_CAPTURE_IMAGE)

"""A camera's recording of video on its own card, by the camera protocol v2.

Whether it records is told by its acknowledgements, and by CAMERA_CAPTURE_STATUS, which counts for
more: where it says otherwise, that is a fault.
"""

from __future__ import annotations

import math

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.payload.camera_status import CaptureStatus
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError

__all__ = ["MavlinkRecorder"]

_START, _STOP = mavlink.MAV_CMD_VIDEO_START_CAPTURE, mavlink.MAV_CMD_VIDEO_STOP_CAPTURE
_SETTLED = 2.0
"""Seconds that a camera has, after its acknowledgement, until its status is to be so."""


class MavlinkRecorder:
    """The recording of one camera; the caller locks."""

    def __init__(self, commander: Commander, flags: int) -> None:
        """Command it by `commander`; `flags` are those of its CAMERA_INFORMATION."""
        self.fault = ""
        """Why it refused the last order, or what it says against its own acknowledgement."""
        self.filming: bool | None = None
        """Whether it records, by its newest word; None while that is not known."""
        self._commander = commander
        self._flags = flags
        self._now = -math.inf
        """Second of its newest turn."""
        self._acknowledged: tuple[bool, float] | None = None
        """The order that its status is compared with, and the second of its acknowledgement."""
        self._confirmed = False
        """Whether its status has agreed."""

    @property
    def ending(self) -> bool:
        """Whether it has been told to end, and has not answered."""
        return self._commander.under_way(_STOP) is not None

    @property
    def unconfirmed(self) -> bool:
        """Whether its status has yet to agree with what it has acknowledged."""
        return self._acknowledged is not None and not self._confirmed

    def step(self, now: float) -> None:
        """Let time pass."""
        self._now = now

    def film(self, now: float, *, on: bool) -> None:
        """Have it begin or end.

        Args:
            now: Monotonic clock, seconds.
            on: Whether to record.

        Raises:
            VehicleError: If the camera says that it cannot.
        """
        if self._flags and not self._flags & mavlink.CAMERA_CAP_FLAGS_CAPTURE_VIDEO:
            raise VehicleError("the camera records no video")
        if self.filming is on and not self.fault:
            # By a word that may be old: the next one is compared with it.
            self._expect(now, on=on)
            return
        before, self.filming, self.fault = self.filming, None, ""
        self._acknowledged = None

        def done(outcome: CommandResult) -> None:
            if outcome.replaced:
                return
            if outcome.accepted:
                self.filming = on
                self._expect(self._now, on=on)
            elif outcome.text != "no answer":
                self.filming, self.fault = before, outcome.text

        # A beginning that is repeated after the end would record on.
        self._commander.withdraw(_STOP if on else _START)
        number, what = (_START, "record video") if on else (_STOP, "end the video")
        self._commander.give(PendingCommand(number, (0.0,) * 7, what), done, now=now)

    def _expect(self, now: float, *, on: bool) -> None:
        self._acknowledged, self._confirmed = (on, now), False

    def heed(self, status: CaptureStatus, now: float) -> None:
        """Compare with what the camera says that it does.

        Args:
            status: Activity of the camera.
            now: Monotonic clock, seconds.
        """
        if any(self._commander.under_way(number) is not None for number in (_START, _STOP)):
            return
        records = status.recording is not None
        if self._acknowledged is None:
            self.filming = records
            return
        on, since = self._acknowledged
        if records is on:
            self.filming, self._confirmed = records, True
            if not on:
                # What it records from now on is somebody else's.
                self._acknowledged = None
        elif now - since >= _SETTLED:
            self.filming, self._acknowledged = records, None
            doing = "still recording" if records else "not recording"
            self.fault = f"the camera says that it is {doing}"

    def give_up(self) -> None:
        """Give up what a camera that is gone has not answered, and know nothing of it."""
        for number in (_START, _STOP):
            self._commander.withdraw(number)
        self.filming = None

"""A camera's lens by the camera protocol v2: zoom and focus, each in percent of its range."""

from __future__ import annotations

from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.messages.payload import LensTarget

__all__ = ["MavlinkLens"]


class MavlinkLens:
    """The lens of one camera; the caller locks."""

    def __init__(self, commander: Commander, flags: int) -> None:
        """Command it by `commander`; `flags` are those of its CAMERA_INFORMATION."""
        self.fault = ""
        """Why it did not take the last target, in a few words."""
        self._commander = commander
        self._flags = flags
        self._open: set[int] = set()
        """Commands that are not answered."""

    @property
    def adjusted(self) -> bool:
        """Whether the last target was acknowledged."""
        return not self._open and not self.fault

    def adjust(self, target: LensTarget, now: float) -> None:
        """Have the lens set.

        Args:
            target: Zoom and focus; None leaves one as it is.
            now: Monotonic clock, seconds.

        Raises:
            VehicleError: If the camera says that it has not what is asked.
        """
        zooms = self._flags & mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_ZOOM
        focuses = self._flags & mavlink.CAMERA_CAP_FLAGS_HAS_BASIC_FOCUS
        if self._flags and target.zoom is not None and not zooms:
            raise VehicleError("the camera has no zoom")
        if self._flags and target.focus is not None and not focuses:
            raise VehicleError("the focus of the camera cannot be set")
        self.fault = ""
        if target.zoom is not None:
            kind = float(mavlink.ZOOM_TYPE_RANGE)
            self._command(mavlink.MAV_CMD_SET_CAMERA_ZOOM, kind, target.zoom, "zoom", now)
        if target.focus is not None:
            kind = float(mavlink.FOCUS_TYPE_RANGE)
            self._command(mavlink.MAV_CMD_SET_CAMERA_FOCUS, kind, target.focus, "focus", now)

    def _command(self, number: int, kind: float, value: float, what: str, now: float) -> None:
        def done(outcome: CommandResult) -> None:
            if outcome.replaced:
                return
            self._open.discard(number)
            if not outcome.accepted:
                self.fault = f"{what}: {outcome.text}"

        # A command that replaces another one of its number ends that one first.
        self._commander.give(
            PendingCommand(number, (kind, value, *[0.0] * 5), f"set the {what}"), done, now=now
        )
        self._open.add(number)

"""Sensor actor in lockstep: captures at the timestamps of the vehicle's states."""

from __future__ import annotations

from aerodaas.actors.lockstep.actor import LockstepActor
from aerodaas.actors.sensor import SensorActor
from aerodaas.cameras.base import Picture
from aerodaas.runtime.session import MESSAGE_DEPTH
from aerodaas.types.data import Header

__all__ = ["LockstepSensorActor"]


class LockstepSensorActor(LockstepActor, SensorActor):
    """Sensor actor that answers each due time, without an image by an empty message."""

    state_depth = MESSAGE_DEPTH

    def _run(self) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        while not self.stopping:
            for message in self.subscriber.receive(0.5):
                self._take(message)
                if self.session.is_due(self._stream, self._sensor.rate, message.stamp):
                    self._capture(message.stamp)

    def _publish(self, picture: Picture | None, stamp: int, taken: int) -> None:
        if picture is None:
            self._frames.measure(None, Header(self._frames.sent, stamp, self._stream), taken)
        else:
            frame = self._frame(picture)
            self._frames.measure(frame, frame.header, taken)

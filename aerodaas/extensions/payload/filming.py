"""Video of a mission: has the camera's recording begun and ended at waypoints, and ended with it.

It only asks and looks, and never waits. What the camera refuses, does not acknowledge, or belies
afterwards is told by an alert; the drone flies on.
"""

from __future__ import annotations

from dataclasses import dataclass

from aerodaas.clock import seconds
from aerodaas.errors import VehicleError, failure_line
from aerodaas.extensions.payload.actions import RecordVideo
from aerodaas.extensions.payload.equipment import Payload, VideoCamera
from aerodaas.mission.log import MissionLog
from aerodaas.mission.navigation.queue import QueuedWaypoint

__all__ = ["Filming"]

_KIND = "video"
"""Kind of the alerts."""


@dataclass(slots=True)
class _Order:
    """Last order to the camera."""

    on: bool
    where: str
    since: int
    """Mission clock, nanoseconds."""
    begins: bool = False
    """Whether the camera did not record before."""
    acknowledged: bool = False
    over: bool = False
    """Whether nothing is awaited of it any more."""


class Filming:
    """Recordings of one mission; `Photographer` calls it."""

    def __init__(self, payload: Payload | None, log: MissionLog, timeout: float) -> None:
        """Use the camera of `payload`, if it has one that is a `VideoCamera`.

        `timeout` in seconds is what it gets to acknowledge; alerts go to `log`.
        """
        self._payload = payload
        self._log = log
        self._timeout = timeout
        self._served: dict[str, QueuedWaypoint] = {}
        """Stops at which the camera was told, by waypoint."""
        self._order: _Order | None = None
        self._ours = False
        """Whether the mission has begun a recording, as far as it knows, that has not ended."""

    def attend(self, stop: QueuedWaypoint, now: int) -> bool:
        """Tell the camera what `stop` asks, once the drone has arrived there.

        Args:
            stop: The stop at which the drone is, or to which it flies.
            now: Mission clock, nanoseconds.

        Returns:
            Whether the drone has to stay there for it; never for longer than the time-out.
        """
        action = stop.waypoint.action(RecordVideo)
        if action is None:
            return False
        if self._served.get(stop.id) is not stop:
            if not stop.arrived:
                return True
            self._served[stop.id] = stop
            self._order_camera(_Order(action.on, f"at {stop.id}", now), now)
            self.poll(now)
        order = self._order
        return order is not None and not (order.acknowledged or order.over)

    def end(self, now: int) -> None:
        """End a recording that the mission has begun."""
        if self._ours:
            self._ours = False
            self._order_camera(_Order(on=False, where="at the end of the mission", since=now), now)

    def poll(self, now: int) -> None:
        """Process the camera's status at `now` (mission clock, ns)."""
        order = self._order
        if order is None or order.over:
            return
        try:
            self._judge(order, self._camera(), now)
        except VehicleError as error:
            # Of one that has acknowledged, a camera that is gone says nothing else.
            if not order.acknowledged:
                self._fail(order, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._fail(order, failure_line(error), now)

    def _judge(self, order: _Order, camera: VideoCamera, now: int) -> None:
        if order.acknowledged:
            if camera.film_fault:
                order.over = True
                text = f"video {_done(order)} {order.where}, but {camera.film_fault}"
                self._log.alert(now, _KIND, text)
        elif camera.film_fault:
            # A recording that it refused to begin is none of the mission's.
            self._ours = self._ours and not order.begins
            self._fail(order, camera.film_fault, now)
        elif camera.filming is order.on:
            order.acknowledged = True
            self._ours = self._ours and order.on
        elif seconds(now - order.since) > self._timeout:
            self._fail(order, f"the camera did not acknowledge it within {self._timeout:g} s", now)

    def _order_camera(self, order: _Order, now: int) -> None:
        before, self._order = self._order, order
        if before is not None and not (before.acknowledged or before.over):
            self._fail(before, "the camera was told otherwise before it acknowledged it", now)
        try:
            camera = self._camera()
            order.begins = order.on and not self._ours and camera.filming is not True
            camera.film(order.on)
            self._ours = self._ours or order.begins
        except VehicleError as error:
            self._fail(order, str(error), now)
        except Exception as error:  # noqa: BLE001 - a driver's camera must not end a flight
            self._fail(order, failure_line(error), now)

    def _camera(self) -> VideoCamera:
        camera = None if self._payload is None else self._payload.photo_camera
        if camera is None:
            raise VehicleError("the vehicle has no camera, or none that answers")
        if not isinstance(camera, VideoCamera):
            raise VehicleError("the camera records no video")
        return camera

    def _fail(self, order: _Order, reason: str, now: int) -> None:
        order.over = True
        self._log.alert(now, _KIND, f"video not {_done(order)} {order.where}: {reason}")


def _done(order: _Order) -> str:
    return "begun" if order.on else "ended"

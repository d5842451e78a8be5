"""Following: the boxes of a detector become velocity commands that keep a drone at its target."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from typing import Any, ClassVar

from aerodaas.analytics.base import Analytics, Context, NavigableAnalytics
from aerodaas.analytics.tracking import Tracker
from aerodaas.data import Alert, Detection, Detections, Frame
from aerodaas.errors import ConfigError, GraphError
from aerodaas.graph import AeroStreamData
from aerodaas.interfaces import IAeroData
from aerodaas.navigation.follow_controller import FollowController, FollowPhase, Observation
from aerodaas.navigation.follow_settings import FollowGains, FollowLimits, LostPolicy
from aerodaas.navigation.sighting import Sighting, TargetSize, sight
from aerodaas.waypoints import DEFAULT_PRIORITY, AeroNavigation, NavigationType

__all__ = ["FollowAnalytics"]

_log = logging.getLogger(__name__)
_WIDTH_MEMORY = 0.1
"""Weight of the newest look in the mean of the target's width: arms swing."""


class FollowAnalytics(NavigableAnalytics):
    """Follows one object of known size at a distance, and stays with that one.

    It locks on the nearest trusted target of its labels and holds it by its track. Until a
    first target is seen, and after one was given up, it commands nothing, so that other
    navigation goes on. The camera must be calibrated (`horizontal_fov` of the sensor). With a
    `detector` of its own it analyses a camera's stream, without one a detector's.
    """

    accepts: ClassVar[tuple[type, ...]] = (Detections, Frame)

    def __init__(
        self,
        labels: Sequence[str] = ("person",),
        distance: float = 2.0,
        height: float = 1.5,
        *,
        target_height: float = 1.7,
        target_width: float = 0.55,
        priority: int = DEFAULT_PRIORITY,
        gains: FollowGains | None = None,
        limits: FollowLimits | None = None,
        lost: LostPolicy | None = None,
        detector: Analytics[Detections] | None = None,
    ) -> None:
        """Follow what carries one of `labels` from `distance`, flying at `height`, in metres.

        `target_height` and `target_width` are the size of the object itself, in metres. Raises
        ConfigError for lengths that are not positive.
        """
        lengths = {
            "distance": distance,
            "height": height,
            "target_height": target_height,
            "target_width": target_width,
        }
        for name, length in lengths.items():
            if not 0.0 < length < math.inf:
                message = f"{type(self).__name__}: {name} must be above 0 m, not {length}"
                raise ConfigError(message)
        self.detector = detector
        self.labels = (labels,) if isinstance(labels, str) else tuple(labels)
        self.size = TargetSize(target_height, target_width)
        self.controller = FollowController(
            distance, height, gains=gains, limits=limits, lost=lost, priority=priority
        )
        self.tracker = Tracker(max_age=self.controller.lost.slow)
        self.target: int | None = None
        """Track that is followed."""
        self._width = target_width
        self._warned = False

    def analyse(self, data: IAeroData[Any]) -> AeroStreamData[AeroNavigation]:
        """Follow in a stream of boxes; in one of frames if there is a detector for them.

        Raises GraphError for any other stream.
        """
        frames = isinstance(data, AeroStreamData) and issubclass(data.item, Frame)
        if frames and self.detector is None:
            message = (
                f"{type(self).__name__} takes boxes, not frames: analyse the camera with an "
                "OnnxDetector first, or pass one as detector="
            )
            raise GraphError(message)
        return super().analyse(data)

    def open(self) -> None:
        """Start the detector, where there is one."""
        if self.detector is not None:
            self.detector.open()

    def close(self) -> None:
        """Release the detector, where there is one."""
        if self.detector is not None:
            self.detector.close()

    def process(self, item: Detections | Frame, context: Context) -> AeroNavigation | None:
        """Return one velocity command, or None where there is nobody to follow."""
        if not isinstance(item, Frame):
            return self._follow(item, context)
        if self.detector is None:
            return None
        found = self.detector.process(item, context)
        return None if found is None else self._follow(found, context)

    def _follow(self, item: Detections, context: Context) -> AeroNavigation | None:
        if item.camera is None:
            self._warn_uncalibrated(item, context)
            return None
        phase = self.controller.phase
        detection = self._target_in(self.tracker.update(item))
        sighting = None if detection is None else self._sight(detection, item)
        state = context.vehicle()
        command = self.controller.step(
            Observation(
                stamp=item.header.stamp,
                sighting=sighting,
                at_capture=item.odometry,
                now=None if state is None else state.odometry,
                now_stamp=None if state is None else state.stamp,
            )
        )
        self._tell_changes(phase, item, context)
        if command is None:
            return None
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])

    def _target_in(self, tracked: Detections) -> Detection | None:
        """Find the target among the boxes of this frame; choose one where there is none."""
        found = tracked.labelled(*self.labels)
        trusted = [item for item in found if item.track_id is not None]
        mine = next((item for item in trusted if item.track_id == self.target), None)
        if mine is not None or not trusted or not self._may_choose():
            return mine
        chosen = max(trusted, key=lambda item: item.area * item.score)
        self.target = chosen.track_id
        self._width = self.size.width
        return chosen

    def _may_choose(self) -> bool:
        """Another target is taken only when the present one has been gone for a while."""
        free = (FollowPhase.WAITING, FollowPhase.SEARCHING)
        return self.target is None or self.controller.phase in free

    def _sight(self, detection: Detection, item: Detections) -> Sighting | None:
        sighting = sight(detection, item, self.size.with_width(self._width))
        if sighting is not None and sighting.width is not None:
            self._width += _WIDTH_MEMORY * (sighting.width - self._width)
        return sighting

    def _tell_changes(self, before: FollowPhase, item: Detections, context: Context) -> None:
        phase = self.controller.phase
        if phase is before:
            return
        _log.info("following: %s, was %s", phase.value, before.value)
        what = " or ".join(self.labels)
        if phase is FollowPhase.SEARCHING:
            context.alert(Alert(item.header, "target_lost", f"The {what} is out of sight."))
        elif phase is FollowPhase.WAITING:
            self.target = None
            text = f"The {what} was not found again; following ends."
            context.alert(Alert(item.header, "target_given_up", text))

    def _warn_uncalibrated(self, item: Detections, context: Context) -> None:
        if self._warned:
            return
        self._warned = True
        text = (
            f"{item.header.source} is not calibrated, so that distances are unknown; "
            "give the sensor its horizontal_fov. Nothing is followed."
        )
        context.alert(Alert(item.header, "camera_uncalibrated", text))

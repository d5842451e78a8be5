"""TowerInspectionAnalytics: approach a tower, climb along it taking images, and land."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np

from aerodaas.analytics.base import Context, NavigableAnalytics, ResourceUse
from aerodaas.analytics.boxes import BoxAnalytics
from aerodaas.analytics.follow.observation import observation
from aerodaas.config.checked import Fraction, Positive
from aerodaas.dataflow.graph import AeroStreamData, Trigger
from aerodaas.dataflow.interfaces import IEnvironment
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError, GraphError
from aerodaas.following.ground_point import GroundView
from aerodaas.following.inspection import InspectionController, InspectionPhase, InspectionPlan
from aerodaas.following.target import RelativeTarget
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.frames import Frame
from aerodaas.messages.readings import Alert
from aerodaas.messages.waypoints import DEFAULT_PRIORITY, NavigationType

__all__ = ["InspectionOver", "TowerInspectionAnalytics", "inspection_over"]

_log = logging.getLogger(__name__)
_MARGIN = 0.02
"""Fraction of the image height within which a box counts as cut by the image's edge."""


class InspectionOver(AeroNavigation):
    """The last navigation of an inspection, a stop; a trigger on it may land the drone."""


def inspection_over(result: object) -> bool:
    """Whether an inspection has ended; a condition for `trigger`."""
    return isinstance(result, InspectionOver)


class TowerInspectionAnalytics(BoxAnalytics[AeroNavigation], NavigableAnalytics):
    """Inspects the first tower that is detected, then lands; until then it sends no commands.

    The drone descends to `base` on its way to the stand-off, climbs to `top` facing the tower,
    descends again and lands in place. The tower's distance is measured at its foot on the ground
    (flat, at the height of home), so the foot must be in the image from the start, as it is for a
    forward-looking camera. The drone never moves towards the tower within the stand-off distance,
    nor while the tower is out of sight. Losing the tower or exceeding the time limit ends the
    inspection.
    """

    resources: ClassVar[Mapping[str, ResourceUse]] = {"pictures": "output"}

    def __init__(
        self,
        environment: IEnvironment | None = None,
        *,
        stand_off: Positive = 8.0,
        base: Positive = 2.0,
        top: Positive = 35.0,
        interval: Positive = 2.0,
        speed: Positive = 1.5,
        climb: Positive = 1.0,
        patience: Positive = 20.0,
        longest: Positive = 600.0,
        width: Positive = 3.0,
        sure: Fraction = 0.5,
        labels: Sequence[str] = ("tower",),
        lands: bool = True,
        pictures: str | Path | None = None,
        priority: int = DEFAULT_PRIORITY,
        detector: BoxAnalytics.Detector | None = None,
    ) -> None:
        """Plan the inspection.

        Args:
            environment: Ignored; accepted because the paper's listings pass it.
            stand_off: Distance to keep from the tower, metres.
            base: Height at which the climb begins and the descent ends, metres above home.
            top: Height at which the climb ends, metres above home.
            interval: Height between two images, metres.
            speed: Speed of the approach, m/s.
            climb: Vertical speed, m/s.
            patience: Longest time without a detection of the tower, seconds.
            longest: Longest time from the beginning to the descent, seconds.
            width: Width of the tower at its foot, metres.
            sure: Least score of a box that begins an inspection, 0 to 1.
            labels: Labels of the boxes to inspect.
            lands: Whether to land at the end; otherwise other navigation takes over.
            pictures: Folder for the images as JPEG, on the machine where the analysis runs; by
                default none are written.
            priority: Priority of the velocity commands.
            detector: Detector for camera streams; by default the shipped one.

        Raises:
            ConfigError: If a number is out of range.
        """
        del environment
        if not 0.0 < width < math.inf:
            raise ConfigError(f"{type(self).__name__}: width must be above 0 m, not {width}")
        plan = InspectionPlan(
            stand_off, base, top, interval, speed, climb, patience=patience, longest=longest
        )
        super().__init__(labels, detector)
        self.controller = InspectionController(plan, priority)
        self.lands = lands
        self.width = width
        self.sure = sure
        self.folder = None if pictures is None else Path(pictures)
        self.taken: list[float] = []
        """Heights of the images taken so far, metres."""
        self._told = False
        self._frame: Frame | None = None

    def _prepare_for(self, item: type) -> None:
        super()._prepare_for(item)
        if self.folder is not None and not issubclass(item, Frame):
            message = (
                f"{type(self).__name__} has no pictures to write to {self.folder}: analyse the "
                "camera's stream, with detector= where you have your own"
            )
            raise GraphError(message)

    def _analyse_stream(self, data: AeroStreamData[Any]) -> AeroStreamData[AeroNavigation]:
        stream = super()._analyse_stream(data)
        if self.node is not None and self.node.robot is not None and self.lands:
            landing = Trigger(self.node.robot, "end_mission", inspection_over)
            if landing not in self.node.triggers:
                self.node.triggers.append(landing)
        return stream

    def process(self, item: Detections | Frame, context: Context) -> AeroNavigation | None:
        """Return one velocity command, or None without a tower to inspect.

        Args:
            item: Frame, or the boxes of one.
            context: Services of its node.
        """
        self._frame = item if isinstance(item, Frame) else None
        return super().process(item, context)

    def examine(self, boxes: Detections, context: Context) -> AeroNavigation | None:
        """Return one velocity command, or None without a tower to inspect."""
        if boxes.camera is None or boxes.odometry is None:
            self.explain_once(boxes, context)
            return None
        if self.controller.phase is InspectionPhase.DONE and self._told:
            return None
        before = self.controller.phase
        least = self.sure if self.controller.phase is InspectionPhase.WAITING else 0.0
        found = [box for box in boxes.labelled(*self.labels) if box.score >= least]
        sighting = self._sight(max(found, key=lambda item: item.score), boxes) if found else None
        command = self.controller.step(observation(boxes, sighting, context))
        self._tell_changes(before, boxes, context)
        if self.controller.picture_due is not None:
            self._take_picture(self.controller.picture_due)
        if command is None:
            return None
        over = self.controller.phase is InspectionPhase.DONE
        self._told = over
        kind = InspectionOver if over else AeroNavigation
        return kind(NavigationType.ANALYTICS_DRIVEN, [command])

    def _sight(self, detection: Detection, boxes: Detections) -> RelativeTarget | None:
        """Bearing and distance of the tower's foot; an upper bound if it is outside the image."""
        left, _, right, bottom = detection.box
        if not all(map(math.isfinite, detection.box)):
            return None
        at_most = self._at_most(detection, boxes)
        try:
            (foot,) = GroundView(boxes).points(np.array([[(left + right) / 2, bottom]]))
        except ValueError:
            return None
        if at_most is None or bottom >= (1 - _MARGIN) * boxes.height or not np.isfinite(foot).all():
            return at_most
        # An occluded foot makes the tower appear farther away.
        distance = min(float(np.hypot(*foot)), at_most.distance)
        return RelativeTarget(math.atan2(foot[1], foot[0]), distance)

    def _at_most(self, detection: Detection, boxes: Detections) -> RelativeTarget | None:
        """Upper bound of the distance: no part of a tower is wider than its foot's diagonal."""
        camera = boxes.camera
        left, top, right, bottom = detection.box
        if camera is None:
            return None
        scale_u, scale_v = camera.width / boxes.width, camera.height / boxes.height
        v = (top + bottom) / 2 * scale_v
        rays = [camera.ray(u * scale_u, v) for u in (left, (left + right) / 2, right)]
        start, middle, end = (math.atan2(ray[1], ray[0]) for ray in rays)
        spread = math.remainder(start - end, math.tau)
        if not 0.0 < spread < math.pi:
            return None
        widest = math.sqrt(2) * self.width
        return RelativeTarget(middle, widest / 2 / math.tan(spread / 2), bound=True)

    def _take_picture(self, height: float) -> None:
        self.taken.append(height)
        if self.folder is None or self._frame is None:
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{len(self.taken):03d}_{height:04.1f}m.jpg"
        if not cv2.imwrite(str(path), self._frame.image):
            _log.warning("%s cannot be written", path)

    def _tell_changes(self, before: InspectionPhase, boxes: Detections, context: Context) -> None:
        controller = self.controller
        if controller.phase is before:
            return
        _log.info("inspection: %s, was %s", controller.phase.value, before.value)
        what = " or ".join(self.labels)
        if controller.phase is InspectionPhase.APPROACHING:
            text = f"A {what} was found; its inspection begins."
            context.alert(Alert(boxes.header, "inspection_began", text))
        if controller.reason and before in {InspectionPhase.APPROACHING, InspectionPhase.CLIMBING}:
            text = f"The inspection ends early: {controller.reason}."
            context.alert(Alert(boxes.header, "inspection_cut_short", text))
        if controller.phase is InspectionPhase.DONE:
            text = f"The inspection is over: {len(self.taken)} pictures."
            context.alert(Alert(boxes.header, "inspection_over", text))

"""A flight with a camera whose pictures tell which they are, and a body found in each."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hovering import console

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.waypoints import FollowedTarget, NavigationType, TargetState, VelocityCommand
from aerodaas.service.own.server import FlightServer

__all__ = ["SHOWN", "Reader", "camera_console", "require_own_frames"]

CAMERA, FINDER, FOLLOWER = "drone/cam", "drone/pose", "drone/follow"
RATE = 10
WIDTH, HEIGHT = 320, 180
TURN = 20
"""Frames after which all repeats itself."""
AMBER = [255, 176, 0]
"""Of a `person`'s box and skeleton."""
SHOWN = """new Promise(done => {
  const screen = document.querySelector('[data-testid=video]');
  const found = [];
  new MutationObserver((_, watch) => {
    const { stamp } = screen.dataset;
    const pixel = (x, y) => [...screen.getContext('2d').getImageData(x, y, 1, 1).data].slice(0, 3);
    const turn = Math.round(stamp / 1e8) % 20;
    found.push([turn, pixel(300, 170), pixel(20 + 10 * turn, 90), pixel(25 + 10 * turn, 60)]);
    if (found.length < 12) return;
    watch.disconnect();
    done(found);
  }).observe(screen, { attributeFilter: ['data-stamp'] });
})"""
"""Of a dozen pictures: which one it is, its grey, and a pixel of its box and of a bone."""


class Reader:
    """Items of the clock's numbers: a frame each tenth of a second, a body found in each."""

    targets: TargetState | None = None
    """How sure the follower is of the body, of every frame; None where there is no follower."""

    def __init__(self, stream: str) -> None:
        self._stream = stream
        self._last = 0

    def next_message(self, timeout: float) -> Message[Any]:
        """The next one that there is; a body is found a while after its frame."""
        del timeout
        late = {FINDER: 0.06, FOLLOWER: 0.09}.get(self._stream, 0.0)
        while (number := int((time.monotonic() - late) * RATE)) <= self._last:
            time.sleep(0.005)
        self._last = number
        header = Header(number, number * 10**9 // RATE, CAMERA)
        turn = number % TURN
        image = np.full((HEIGHT, WIDTH, 3), 40 + 8 * turn, np.uint8)
        depth = np.full((HEIGHT, WIDTH), 2000, np.uint16)
        depth[:, WIDTH // 2 :] = 0
        frame = Frame(header, image, depth=depth)
        found = Detections.of(frame, [body(20.0 + 10 * turn)])
        items: dict[str, Any] = {FINDER: found, FOLLOWER: followed(found[0], Reader.targets)}
        item = items.get(self._stream, frame)
        return Message(self._stream, number, header.stamp, header, 0, (), item)


def followed(one: Detection, state: TargetState | None) -> AeroNavigation:
    """The command of a follower of this body, which is not seen where that has no box."""
    seen = state in {TargetState.SURE, TargetState.LIKELY}
    left, top, right, bottom = map(float, one.box)
    box = (left, top, right, bottom) if seen else None
    target = None if state is None else FollowedTarget(state, box)
    return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(target=target)])


def body(left: float) -> Detection:
    """One whose left arm hangs straight down, 5 pixels right of its box's left edge."""
    points = np.zeros((17, 3), np.float32)
    points[5], points[7] = (left + 5, 40, 0.9), (left + 5, 80, 0.9)
    points[9] = (left + 5, 120, 0.1)
    return Detection((left, 30.0, left + 40, 150.0), "person", 0.8, keypoints=points)


@contextmanager
def camera_console() -> Iterator[FlightServer]:
    """The console of this flight."""
    nodes = {
        name: SimpleNamespace(id=name, item=kind, dormant=False)
        for name, kind in ((CAMERA, Frame), (FINDER, Detections), (FOLLOWER, AeroNavigation))
    }
    with console() as (server, run):
        run.graph = SimpleNamespace(nodes=nodes, reader=Reader)  # type: ignore[assignment]
        yield server


def require_own_frames(shown: list[Any]) -> None:
    """Require of what SHOWN has found that each body is drawn on the frame that it was found in."""
    for turn, grey, edge, bone in shown:
        assert grey == pytest.approx([40 + 8 * turn] * 3, abs=4)
        assert edge == pytest.approx(AMBER, abs=12)
        assert bone == pytest.approx(AMBER, abs=12)

"""Following a hazard vest with a Tello: from its box to the sticks."""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from box_detector import Box
from djitellopy import BackgroundFrameRead, Tello
from numpy.typing import NDArray

LENS = math.radians(55.2)
VEST_HEIGHT, VEST_WIDTH = 0.6, 0.43
DISTANCE, HEIGHT = 2.0, 1.5
SPEED_GAIN, YAW_GAIN, CLIMB_GAIN, SMOOTHING = 0.9, 1.5, 1.0, 0.7
FULL_SPEED, FULL_TURN = 1.0, math.radians(100)
FORGET, SEARCH, SEARCH_TURN = 0.6, 3.0, 0.5
EDGE, WIDER = 0.03, 1.2
LYING = 0.8


class VestFollower:
    """Keeps the distance and the person's own speed, faces the vest, and holds the height."""

    def __init__(self, tello: Tello, camera_pitch: float) -> None:
        self.tello, self.camera_pitch = tello, camera_pitch
        self.last = self.seen = time.monotonic()
        self.away, self.bearing, self.walking = DISTANCE, 0.0, 0.0
        self.lying = False

    def unseen(self) -> float:
        """Seconds since it last saw the vest."""
        return time.monotonic() - self.seen

    def follow(self, box: Box | None, image: NDArray[Any]) -> None:
        """Steer by the vest's box in a picture, or without one."""
        now = time.monotonic()
        step, self.last = now - self.last, now
        forward = turn = 0.0
        if self.lying or self.unseen() > FORGET:
            self.walking = 0.0
        if box is not None:
            before, fresh = self.away, self.unseen() < FORGET
            self.locate(box, image)
            self.seen = now
            if fresh and not self.lying:
                speed = own_speed(self.tello) + (self.away - before) / step
                self.walking += min(1.0, step / SMOOTHING) * (speed - self.walking)
                forward = SPEED_GAIN * (self.away - DISTANCE) + self.walking
            turn = YAW_GAIN * self.bearing
        elif self.unseen() > SEARCH:
            turn = math.copysign(SEARCH_TURN, self.bearing)
        steer(self.tello, forward, 0.0, turn)

    def locate(self, box: Box, image: NDArray[Any]) -> None:
        """Find the vest's distance and direction (radians to the left), and whether it lies."""
        height, width = image.shape[:2]
        focal = width / 2 / math.tan(LENS / 2)
        tilt = math.radians(self.tello.get_pitch()) - self.camera_pitch
        top, middle, bottom = (
            math.tan(math.atan2(height / 2 - v, focal) + tilt) for v in (box.top, box.v, box.bottom)
        )
        by_width = VEST_WIDTH * focal / (box.right - box.left)
        self.away = min(VEST_HEIGHT / (top - bottom), WIDER * by_width)
        if box.top < EDGE * height or box.bottom > (1 - EDGE) * height:
            self.away = min(self.away, by_width)
        self.bearing = math.atan2(width / 2 - box.u, focal)
        self.lying = self.tello.get_height() / 100 + self.away * middle < LYING


def own_speed(tello: Tello) -> float:
    """How fast it flies where it looks, m/s."""
    yaw = math.radians(tello.get_yaw())
    ahead, right = tello.get_speed_x() / 10, tello.get_speed_y() / 10
    return float(ahead * math.cos(yaw) + right * math.sin(yaw))


def steer(tello: Tello, forward: float, left: float, turn: float) -> None:
    """Set the sticks by m/s and rad/s (to the left), and hold the height."""
    climb = CLIMB_GAIN * (HEIGHT - tello.get_height() / 100)
    tello.send_rc_control(
        *(percent(-left, FULL_SPEED), percent(forward, FULL_SPEED)),
        *(percent(climb, FULL_SPEED), percent(-turn, FULL_TURN)),
    )


def next_frame(video: BackgroundFrameRead, last: NDArray[Any] | None = None) -> NDArray[Any]:
    """Wait for a picture other than the last one."""
    while (frame := video.frame) is last:
        time.sleep(0.005)
    return np.asarray(frame)


def percent(value: float, full: float) -> int:
    """A stick's position."""
    return max(-100, min(100, round(100 * value / full)))

"""Commands of a Tello, and the meaning of its replies (SDK 2.0 and 3.0 user guides).

No relative move (`forward 50`, `go …`) is among the commands: its reply may be lost although the
move was made, so that it can be neither repeated nor omitted. All motion is by `rc`, whose newest
value replaces the previous one, and which has no minimum distance.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

import numpy as np

from aerodaas.geometry.frames import Vector

__all__ = [
    "ENTER",
    "LAND",
    "STILL",
    "STREAM_ON",
    "TAKE_OFF",
    "VERSION",
    "BodyMotion",
    "Command",
    "StickScale",
    "Sticks",
    "ports",
]

_FULL = 100
"""Percent: the range of each stick of `rc` is -100 to 100."""

_OK = re.compile(r"ok|\d+", re.IGNORECASE)
_WORDS = re.compile(r"[A-Za-z][\w ?!.,:;/'~-]+")


@dataclass(frozen=True, slots=True)
class Command:
    """One request to which the Tello replies."""

    text: str
    timeout: float
    """Seconds to wait for the reply."""
    tries: int = 1
    """More than one only for idempotent commands."""

    def accepts(self, reply: str) -> bool:
        """Whether `reply` can belong to this command: numbers answer queries only."""
        if reply.startswith("unknown command"):
            return True
        if self.text.endswith("?"):
            return reply.isdecimal()
        return _WORDS.fullmatch(reply) is not None

    @staticmethod
    def succeeded(reply: str) -> bool:
        """Whether `reply` reports success."""
        return _OK.fullmatch(reply) is not None


ENTER = Command("command", timeout=0.5, tries=3)
"""Enter SDK mode; until then a Tello neither listens nor sends."""
VERSION = Command("sdk?", timeout=1.0, tries=2)
"""Ask for the SDK's version: 20 or 30; SDK 1.3 does not answer it."""
STREAM_ON = Command("streamon", timeout=2.0, tries=3)
TAKE_OFF = Command("takeoff", timeout=20.0)
"""Rise to about a metre. The reply comes when it hovers; users wait up to 20 s."""
LAND = Command("land", timeout=8.0, tries=3)
"""Land here. The reply comes when it stands."""


def ports(state: int, video: int) -> Command:
    """Set the ports of this host to which the Tello sends; SDK 3.0.

    Args:
        state: Port for states.
        video: Port for video.
    """
    return Command(f"port {state} {video}", timeout=1.0, tries=3)


@dataclass(frozen=True, slots=True, eq=False)
class BodyMotion:
    """Velocity of a Tello in its own level frame."""

    velocity: Vector
    """m/s forward, left, up (FLU)."""
    yaw_rate: float = 0.0
    """rad/s counter-clockwise."""


@dataclass(frozen=True, slots=True)
class Sticks:
    """The four percentages of `rc`, each -100 to 100."""

    right: int = 0
    ahead: int = 0
    up: int = 0
    clockwise: int = 0

    @property
    def text(self) -> str:
        """The command that sets the sticks; it has no reply."""
        return f"rc {self.right} {self.ahead} {self.up} {self.clockwise}"


STILL = Sticks()
"""Hover."""


@dataclass(frozen=True, slots=True)
class StickScale:
    """The motion at 100 % of each stick, taken as proportional in between."""

    speed: float
    """m/s horizontally."""
    climb: float
    """m/s vertically."""
    turn: float
    """rad/s."""

    def sticks(self, motion: BodyMotion) -> Sticks:
        """Sticks for `motion`, clipped to 100 %."""
        ahead, left, up = motion.velocity
        return Sticks(
            _percent(-left / self.speed),
            _percent(ahead / self.speed),
            _percent(up / self.climb),
            _percent(-motion.yaw_rate / self.turn),
        )

    def motion(self, sticks: Sticks) -> BodyMotion:
        """Steady motion of a Tello with these `sticks`."""
        ahead, left = sticks.ahead * self.speed, -sticks.right * self.speed
        velocity = np.array([ahead, left, sticks.up * self.climb]) / _FULL
        return BodyMotion(velocity, -sticks.clockwise * self.turn / _FULL)


def _percent(share: float) -> int:
    if not math.isfinite(share):
        return 0
    return min(max(round(_FULL * share), -_FULL), _FULL)

"""The SDK's commands as a Tello understands them: ranges, replies, refusals.

Written from the SDK 2.0 and 3.0 user guides, on its own: the driver shares nothing with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.options import TelloOptions

__all__ = ["Outcome", "TelloSdk"]

_MOVES = {
    "up": (0, 0, 1),
    "down": (0, 0, -1),
    "left": (0, 1, 0),
    "right": (0, -1, 0),
    "forward": (1, 0, 0),
    "back": (-1, 0, 0),
}
"""Ahead, left and up of one unit."""

_MOVE = (20, 500)
_TURN = (1, 360)
_PLACE = (-500, 500)
_TOO_NEAR = 20
_SPEED = (10, 100)
_CURVE_SPEED = (10, 60)
_RADIUS = (50, 1000)
_STICK = (-100, 100)
_LOWEST_CHARGE = 0.1
_PORTS = (1024, 65535)
_BIT_RATES = (0, 5)

_SDK_3 = 30

OUT_OF_RANGE = "out of range"
BUSY = "error Not joystick"
NOT_FLYING = "error Motor stop"


@dataclass(frozen=True)
class Outcome:
    """The effect of a command."""

    reply: str | None = None
    """At once; None for `rc`, or where the reply comes when the motion is done."""
    moves: bool = False
    """True if `ok` follows once the flight has settled."""


class TelloSdk:
    """One Tello's ear: `handle` carries a command out."""

    def __init__(self, options: TelloOptions, flight: TelloFlight) -> None:
        """Fly `flight`."""
        self.entered = False
        """True after `command`; before, no other command is accepted."""
        self.streaming = False
        self.ports = (8890, 11111)
        """For state and video."""
        self._options = options
        self._flight = flight
        self._speed = 100
        """cm/s of the directional moves."""
        self._handlers: dict[str, Callable[[str, list[int]], Outcome]] = {
            "takeoff": self._take_off,
            "land": self._land,
            "stop": self._stop,
            "emergency": self._cut,
            "streamon": self._stream,
            "streamoff": self._stream,
            "speed": self._set_speed,
            "setbitrate": self._set_bit_rate,
            "rc": self._sticks,
            **dict.fromkeys(_MOVES, self._move),
            "cw": self._turn,
            "ccw": self._turn,
            "go": self._go,
            "curve": self._curve,
        }
        if options.sdk >= _SDK_3:
            self._handlers["port"] = self._set_ports

    def handle(self, text: str) -> Outcome:
        """Carry out `text`."""
        name, *words = text.split()
        if name == "command":
            self.entered = True
            return Outcome("ok")
        if not self.entered:
            return Outcome()
        if name.endswith("?") and not words:
            return Outcome(self._answer(name))
        handler = self._handlers.get(name)
        if handler is None:
            return Outcome(f"unknown command: {name}")
        try:
            numbers = [int(word) for word in words]
        except ValueError:
            return Outcome(f"error: {text}")
        return handler(name, numbers)

    def _answer(self, question: str) -> str:
        state = dict(part.split(":") for part in self._flight.state().strip().split(";") if part)
        answers = {
            "battery?": state["bat"],
            "speed?": f"{self._speed:.1f}",
            "time?": f"{state['time']}s",
            "height?": f"{int(state['h']) // 10}dm",
            "temp?": f"{state['templ']}~{state['temph']}C",
            "attitude?": f"pitch:{state['pitch']};roll:{state['roll']};yaw:{state['yaw']};",
            "baro?": state["baro"],
            "tof?": f"{int(state['tof']) * 10}mm",
            "wifi?": "90",
            "sdk?": str(self._options.sdk),
            "sn?": "0TQDEMULATED00",
        }
        return answers.get(question, f"unknown command: {question}")

    def _take_off(self, _: str, numbers: list[int]) -> Outcome:
        if numbers or self._flight.flying:
            return Outcome("error")
        if self._flight.charge < _LOWEST_CHARGE:
            return Outcome(NOT_FLYING)
        self._flight.take_off()
        return Outcome(moves=True)

    def _land(self, _: str, __: list[int]) -> Outcome:
        if not self._flight.flying:
            return Outcome("error")
        self._flight.land()
        return Outcome(moves=True)

    def _stop(self, _: str, __: list[int]) -> Outcome:
        if not self._flight.flying:
            return Outcome("error")
        self._flight.stop()
        return Outcome("ok")

    def _cut(self, _: str, __: list[int]) -> Outcome:
        self._flight.cut()
        return Outcome("ok")

    def _stream(self, name: str, _: list[int]) -> Outcome:
        self.streaming = name == "streamon"
        return Outcome("ok")

    def _set_speed(self, _: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [_SPEED]):
            return Outcome(OUT_OF_RANGE)
        self._speed = numbers[0]
        return Outcome("ok")

    def _set_ports(self, _: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [_PORTS, _PORTS]):
            return Outcome(OUT_OF_RANGE)
        self.ports = (numbers[0], numbers[1])
        return Outcome("ok")

    def _set_bit_rate(self, _: str, numbers: list[int]) -> Outcome:
        return Outcome("ok" if _within(numbers, [_BIT_RATES]) else OUT_OF_RANGE)

    def _sticks(self, _: str, numbers: list[int]) -> Outcome:
        if _within(numbers, [_STICK] * 4) and self._flight.settled:
            self._flight.steer(*numbers)
        return Outcome()

    def _move(self, name: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [_MOVE]):
            return Outcome(OUT_OF_RANGE)
        ahead, left, up = (axis * numbers[0] / 100 for axis in _MOVES[name])
        return self._fly(lambda: self._flight.move(ahead, left, up, self._speed / 100))

    def _turn(self, name: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [_TURN]):
            return Outcome(OUT_OF_RANGE)
        degrees = numbers[0] if name == "ccw" else -numbers[0]
        return self._fly(lambda: self._flight.turn(degrees))

    def _go(self, _: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [_PLACE, _PLACE, _PLACE, _SPEED]):
            return Outcome(OUT_OF_RANGE)
        x, y, z, speed = numbers
        if max(abs(x), abs(y), abs(z)) <= _TOO_NEAR:
            return Outcome(OUT_OF_RANGE)
        return self._fly(lambda: self._flight.move(x / 100, y / 100, z / 100, speed / 100))

    def _curve(self, _: str, numbers: list[int]) -> Outcome:
        if not _within(numbers, [*([_PLACE] * 6), _CURVE_SPEED]):
            return Outcome(OUT_OF_RANGE)
        radius = _radius(numbers[:3], numbers[3:6])
        if not _RADIUS[0] <= radius <= _RADIUS[1]:
            return Outcome("error Radius is too large!")
        # The chord stands for the arc: what matters here is where it ends and when it replies.
        x, y, z, speed = (value / 100 for value in numbers[3:])
        return self._fly(lambda: self._flight.move(x, y, z, speed))

    def _fly(self, start: Callable[[], None]) -> Outcome:
        if not self._flight.flying:
            return Outcome(NOT_FLYING)
        if not self._flight.settled:
            return Outcome(BUSY)
        start()
        return Outcome(moves=True)


def _within(numbers: list[int], ranges: Sequence[tuple[int, int]]) -> bool:
    return len(numbers) == len(ranges) and all(
        lowest <= number <= highest
        for number, (lowest, highest) in zip(numbers, ranges, strict=True)
    )


def _radius(first: list[int], second: list[int]) -> float:
    """Radius of the circle through the origin and two points; infinite on a line."""
    a, b = math.hypot(*first), math.hypot(*second)
    c = math.dist(first, second)
    half = (a + b + c) / 2
    area = math.sqrt(max(0.0, half * (half - a) * (half - b) * (half - c)))
    return a * b * c / (4 * area) if area > 0.0 else math.inf

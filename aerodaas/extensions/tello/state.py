"""The state that a Tello sends ten times a second: `pitch:0;roll:0;…;bat:87;…`.

Truncated, garbled or foreign packets are common on Wi-Fi, so they are an expected result and no
error: a packet that cannot be parsed completely is refused.
"""

from __future__ import annotations

import math
import re
import statistics
from collections import deque
from dataclasses import dataclass

from aerodaas.messages.odometry import Battery

__all__ = ["BatteryGauge", "TelloState", "parse_state"]

_NUMBER = re.compile(r" *([+-]?\d{1,9}(?:\.\d{1,9})?) *", re.ASCII)

_RANGES = {
    "pitch": (-180.0, 180.0),
    "roll": (-180.0, 180.0),
    "yaw": (-180.0, 180.0),
    "vgx": (-300.0, 300.0),
    "vgy": (-300.0, 300.0),
    "vgz": (-300.0, 300.0),
    "templ": (-40.0, 150.0),
    "temph": (-40.0, 150.0),
    "tof": (0.0, 10_000.0),
    "h": (-10_000.0, 10_000.0),
    "bat": (0.0, 100.0),
    "baro": (-1_000.0, 10_000.0),
    "time": (0.0, 1e6),
}
"""The needed fields, and the plausible range of each, in the SDK's units."""


@dataclass(frozen=True, slots=True)
class TelloState:
    """One state packet in SI units.

    Velocities are in the ground frame whose x points along the Tello's heading when it was switched
    on (yaw zero), y to the right of that, z down. The SDK gives no unit; pilots measured
    decimetres per second (tello-vision-telemetry-lab, aerostack2).
    """

    roll: float
    """Radians, positive with the right side down."""
    pitch: float
    """Radians, positive with the nose down; the SDK's own sign is the other."""
    yaw: float
    """Radians clockwise from its heading when it was switched on."""
    velocity: tuple[float, float, float]
    """m/s along x, y, z (down); in steps of 0.1 m/s."""
    height: float
    """Metres above the place of take-off, in steps of 0.1 m."""
    ground_distance: float
    """Metres to the surface below, by time of flight: 0.1 on the ground, 65.53 out of range."""
    barometer: float
    """Metres above the sea by air pressure: only its changes are accurate."""
    battery: int
    """Percent."""
    motor_time: float
    """Seconds for which the motors have run."""
    temperature: float
    """Degrees Celsius at the hottest place."""


def parse_state(datagram: bytes) -> TelloState | None:
    """Parse a state packet; None if it is invalid or incomplete."""
    try:
        text = datagram.decode("ascii")
    except UnicodeDecodeError:
        return None
    fields = _fields(text)
    if fields is None or len(fields) < len(_RANGES):
        return None
    for name, (lowest, highest) in _RANGES.items():
        if not lowest <= fields[name] <= highest:
            return None
    return TelloState(
        roll=math.radians(fields["roll"]),
        pitch=-math.radians(fields["pitch"]),
        yaw=math.radians(fields["yaw"]),
        velocity=(fields["vgx"] / 10, fields["vgy"] / 10, fields["vgz"] / 10),
        height=fields["h"] / 100,
        ground_distance=fields["tof"] / 100,
        barometer=fields["baro"],
        battery=int(fields["bat"]),
        motor_time=fields["time"],
        temperature=fields["temph"],
    )


def _fields(text: str) -> dict[str, float] | None:
    """Fields of `text` by name; None if a needed field is invalid or duplicate.

    The rest after the last semicolon may be truncated and is ignored.
    """
    found: dict[str, float] = {}
    for part in text.split(";")[:-1]:
        name, _, value = part.strip(" ").partition(":")
        if name not in _RANGES:
            continue
        number = _NUMBER.fullmatch(value)
        if name in found or number is None:
            return None
        found[name] = float(number[1])
    return found


_WINDOW = 9
"""Packets, 0.9 s: a reading must hold for half of it before it counts."""


class BatteryGauge:
    """The median of the newest percentages."""

    def __init__(self) -> None:
        """Start without a reading."""
        self._percent: deque[int] = deque(maxlen=_WINDOW)

    def add(self, percent: int) -> None:
        """Add the percentage of one packet, 0 to 100."""
        self._percent.append(percent)

    @property
    def battery(self) -> Battery:
        """Present charge; NaN before the first packet."""
        if not self._percent:
            return Battery(float("nan"))
        return Battery(statistics.median(self._percent) / 100)

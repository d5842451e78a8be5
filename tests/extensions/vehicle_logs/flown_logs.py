"""A flight as its recording and as the logs that ArduPilot and PX4 would write of it.

The formats are written here from their public specifications, by the least that a flight needs.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder

EPOCH = 1_800_000_000
"""Second since 1970 at which the mission begins."""
_FIELDS = {
    "Q": "Q",
    "f": "f",
    "B": "B",
    "h": "h",
    "H": "H",
    "N": "16s",
    "Z": "64s",
    "c": "h",
    "C": "H",
    "I": "I",
}
_FORMATS = {
    "PARM": (0x10, "QNff", "TimeUS,Name,Value,Default"),
    "MSG": (0x11, "QZ", "TimeUS,Message"),
    "ERR": (0x12, "QBB", "TimeUS,Subsys,ECode"),
    "BAT": (0x13, "QBff", "TimeUS,Inst,Volt,Curr"),
    "ATT": (0x14, "QccccCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw"),
    "XKF1": (0x15, "QBfff", "TimeUS,C,VN,VE,VD"),
    "VIBE": (0x19, "QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip"),
    "RCOU": (0x1C, "QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6"),
}


@dataclass(frozen=True)
class Flown:
    """One flight: what its vehicle did at a mission second, and what its clock read then."""

    zero: float = 42.0
    """Seconds that the autopilot had run for when the mission began."""
    rate: float = 1.0 + 50e-6
    duration: float = 60.0
    phase: float = 0.0
    """Another phase, another way."""

    def clock(self, mission: float) -> float:
        """Seconds of the autopilot's clock."""
        return self.zero + self.rate * mission

    def velocity(self, mission: float) -> tuple[float, float, float]:
        """East, north and up in m/s."""
        angle = 0.3 * mission + self.phase
        return 4.0 * math.cos(angle), 4.0 * math.sin(angle), 0.5 * math.sin(0.7 * mission)


def record_flown(
    path: Path, flown: Flown, *, robots: Sequence[str] = ("drone",), error: float | None = 0.002
) -> Path:
    """Record its states; `error` is TIMESYNC's, None for an autopilot that tells none."""
    provenance = Provenance(started_ns=EPOCH * 10**9, name="survey", versions={"aerodaas": "0.1.0"})
    with FlightRecorder(path, config=RecordingConfig(), provenance=provenance) as recorder:
        for step in range(round(flown.duration * 10)):
            now = step / 10.0
            for robot in robots:
                name = f"{robot}/@state"
                stamp = round(now * 1e9)
                header = Header(step, stamp, name)
                state = _state(stamp, flown, error)
                recorder.write(Message(name, step, stamp, header, 0, (), state))
    return path


def _state(stamp: int, flown: Flown, error: float | None) -> VehicleState:
    now = stamp / 1e9
    extra: dict[str, Any] = {"autopilot_time": flown.clock(now)}
    if error is not None:
        extra["autopilot_time_error"] = error
    odometry = Odometry(np.zeros(3), np.array(flown.velocity(now)), 0.0)
    armed = 5.0 <= now <= flown.duration - 5.0
    return VehicleState(
        stamp, odometry, Battery(0.9, 15.2, 11.0), VehicleMode.GUIDED, armed=armed, extra=extra
    )


def dataflash(flown: Flown, *, begin: float = 0.0, end: float | None = None) -> bytes:
    """ArduPilot's log of a flight, between two seconds of the mission."""
    log = bytearray(_format(0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))
    for name, (kind, fields, columns) in _FORMATS.items():
        size = 3 + struct.calcsize("<" + "".join(_FIELDS[one] for one in fields))
        log += _format(kind, size, name, fields, columns)
    # Channels 1 and 2 drive motors 2 and 1, channel 3 a gimbal.
    told = {"SERVO1_FUNCTION": 34, "SERVO2_FUNCTION": 33, "SERVO3_FUNCTION": 6}
    told |= {"MOT_PWM_MIN": 1100, "MOT_PWM_MAX": 1900}
    for name, value in told.items():
        log += _message("PARM", _us(flown, begin), name.encode(), value, value)
    log += _message("MSG", _us(flown, begin), b"ArduCopter V4.7.0")
    until = flown.duration if end is None else end
    for step in range(round(10 * begin), round(10 * until)):
        now = step / 10.0
        at = _us(flown, now)
        east, north, up = flown.velocity(now)
        log += _message("BAT", at, 0, 15.2 - now / 100, 11.0)
        log += _message("BAT", at, 1, 5.0, 0.5)
        log += _message("ATT", at, 110, 100, -210, -200, 9000, 8950)
        log += _message("XKF1", at, 0, north, east, -up)
        log += _message("XKF1", at, 1, 99.0, 99.0, 99.0)
        log += _message("VIBE", at, 0, 3.0, 4.0, 5.0, 0)
        log += _message("RCOU", at, 1500, 1300, 1500, 0, 0, 0)
    log += _message("ERR", _us(flown, until), 16, 2)
    return bytes(log)


def _us(flown: Flown, mission: float) -> int:
    return round(1e6 * flown.clock(mission))


def _format(kind: int, size: int, name: str, fields: str, columns: str) -> bytes:
    body = struct.pack("<BB4s16s64s", kind, size, name.encode(), fields.encode(), columns.encode())
    return b"\xa3\x95\x80" + body


def _message(name: str, *values: Any) -> bytes:  # noqa: ANN401 - as the fields are
    kind, fields, _ = _FORMATS[name]
    return bytes((0xA3, 0x95, kind)) + struct.pack(
        "<" + "".join(_FIELDS[one] for one in fields), *values
    )


_ULOG = {
    "battery_status": "uint64_t timestamp;float voltage_v;float current_a;uint8_t[4] _padding0;",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "vehicle_attitude_setpoint": "uint64_t timestamp;float[4] q_d;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float vz;",
    "vehicle_imu_status": "uint64_t timestamp;float accel_vibration_metric;",
    "actuator_motors": "uint64_t timestamp;float[12] control;",
}


def ulog(
    flown: Flown,
    *,
    begin: float = 0.0,
    end: float | None = None,
    extra: str = "",
    current: float = 11.0,
) -> bytes:
    """PX4's log of a flight, between two seconds of the mission; `extra` is one more format."""
    log = bytearray(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", _us(flown, begin)))
    log += _ulog("B", bytes(40))
    for text in (*(f"{name}:{fields}" for name, fields in _ULOG.items()), *filter(None, [extra])):
        log += _ulog("F", text.encode())
    for number, name in enumerate(_ULOG):
        log += _ulog("A", struct.pack("<BH", 0, number) + name.encode())
    turned = math.sin(math.radians(15.0)), math.cos(math.radians(15.0))
    until = flown.duration if end is None else end
    for step in range(round(10 * begin), round(10 * until)):
        now = step / 10.0
        east, north, up = flown.velocity(now)
        rows = (
            (15.2, current),
            (turned[1], turned[0], 0.0, 0.0),
            (turned[1], 0.0, turned[0], 0.0),
            (north, east, -up),
            (4.5,),
            (0.5, 0.25, *[math.nan] * 10),
        )
        for number, row in enumerate(rows):
            values = struct.pack(f"<{len(row)}f", *row)
            log += _ulog("D", struct.pack("<HQ", number, _us(flown, now)) + values)
    warning = struct.pack("<BQ", ord("4"), _us(flown, until)) + b"Landing detected"
    return bytes(log + _ulog("L", warning))


def _ulog(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body

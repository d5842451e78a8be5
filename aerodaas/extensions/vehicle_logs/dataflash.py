"""ArduPilot's DataFlash logs (`.bin`).

The format tells itself (ArduPilot's AP_Logger/LogStructure.h; what the messages mean:
https://ardupilot.org/copter/docs/logmessages.html): each message begins with A3 95 and a type;
messages FMT give the length, name, fields and columns of each type. It is read here, for
pymavlink's own reader is under the GPL.
"""

from __future__ import annotations

import struct
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import RecordingError
from aerodaas.extensions.vehicle_logs.log import Floats, LogText, Series, Topic, VehicleLog

__all__ = ["DATAFLASH_HEAD", "read_dataflash"]

DATAFLASH_HEAD = b"\xa3\x95\x80"
"""First bytes of a log: its first message is a FMT."""

_MARK = DATAFLASH_HEAD[:2]
_FMT = 0x80
_FMT_SIZE = 89
_FMT_BODY = struct.Struct("<BB4s16s64s")
"""Type, bytes with the head, name, a letter for each field, columns with commas between."""
_FIELDS = {
    letter: field
    for letters, field in (
        *(("b", "i1"), ("BM", "u1"), ("hc", "<i2"), ("HC", "<u2"), ("ieL", "<i4"), ("IE", "<u4")),
        *(("q", "<i8"), ("Q", "<u8"), ("g", "<f2"), ("f", "<f4"), ("d", "<f8")),
        *(("a", "V64"), ("n", "S4"), ("N", "S16"), ("Z", "S64")),
    )
    for letter in letters
}
"""Fields by their letter."""
_SCALES = {"c": 0.01, "C": 0.01, "e": 0.01, "E": 0.01, "L": 1e-7}
_KINDS = {"TimeUS": "iu", "Message": "S", "Name": "S"}
"""NumPy's kinds of the fields that are no plain number, in the messages that are read here."""
_INSTANCES = ("I", "C", "IMU", "Inst", "Instance")
"""Columns that number the sensor or the estimator's core; the first one is shown."""
_MICROSECONDS = 1e6
_MOTORS = {*range(33, 41), *range(82, 86), *range(160, 180)}
"""SERVOn_FUNCTION of motors 1 to 8, 9 to 12 and 13 to 32."""
_SERVOS = 32
_PWM = (1000.0, 2000.0)
"""Microseconds of no and of full thrust where MOT_PWM_MIN and MOT_PWM_MAX are not in the log."""

_TOPICS: tuple[tuple[Topic, str, dict[str, tuple[str, float]]], ...] = (
    ("battery", "BAT", {"voltage": ("Volt", 1), "current": ("Curr", 1)}),
    ("attitude", "ATT", {"roll": ("Roll", 1), "pitch": ("Pitch", 1), "heading": ("Yaw", 1)}),
    (
        "attitude setpoint",
        "ATT",
        {"roll": ("DesRoll", 1), "pitch": ("DesPitch", 1), "heading": ("DesYaw", 1)},
    ),
    ("velocity", "XKF1", {"east": ("VE", 1), "north": ("VN", 1), "up": ("VD", -1)}),
    ("vibration", "VIBE", {"x": ("VibeX", 1), "y": ("VibeY", 1), "z": ("VibeZ", 1)}),
)
"""Topic, message, and each column's field with its sign."""
_WANTED = {
    *(message for _, message, _ in _TOPICS),
    *("ERR", "MSG", "PARM", "RCOU"),
}

_Table = NDArray[np.void]


@dataclass(frozen=True, slots=True)
class _Format:
    name: str
    size: int
    """Bytes of a message, with its head."""
    letters: str
    columns: tuple[str, ...]

    @classmethod
    def unpack(cls, body: bytes) -> tuple[int, _Format | None]:
        """The type that a FMT describes, and how; None for one that contradicts itself."""
        kind, size, name, letters, columns = _FMT_BODY.unpack(body)
        named = cls(
            _text(name), size, _text(letters), tuple(filter(None, _text(columns).split(",")))
        )
        wanted = sum(
            np.dtype(_FIELDS[letter]).itemsize for letter in named.letters if letter in _FIELDS
        )
        fits = len(named.letters) == len(named.columns) == len(set(named.columns))
        return kind, named if fits and wanted + 3 == size else None

    @property
    def sound(self) -> bool:
        """Whether its fields are of the kinds that they have in the messages read here."""
        kinds = [np.dtype(_FIELDS[letter]).kind for letter in self.letters if letter in _FIELDS]
        known = len(kinds) == len(self.columns) > 0
        return known and all(
            kind in _KINDS.get(column, "iuf")
            for kind, column in zip(kinds, self.columns, strict=True)
        )

    @property
    def dtype(self) -> np.dtype[np.void]:
        """The message's structure."""
        fields = [_FIELDS[letter] for letter in self.letters]
        return np.dtype(list(zip(self.columns, fields, strict=True)))


def read_dataflash(content: bytes | memoryview) -> VehicleLog:
    """Read a log; what is broken in it is left out and told.

    Raises:
        RecordingError: If it holds no message with a time.
    """
    tables, scales, lost = _tables(content)
    topics: dict[Topic, Series] = {
        topic: series
        for topic, message, columns in _TOPICS
        if (series := _series(tables.get(message), scales, message, columns)) is not None
    }
    motors = _motors(tables)
    if motors is not None:
        topics["motors"] = motors
    texts = tuple(sorted((*_messages(tables), *_errors(tables)), key=lambda one: one.time))
    times = [one.time for one in topics.values()] + [np.array([one.time for one in texts])]
    joined = np.concatenate(times)
    if not len(joined):
        raise RecordingError(
            "holds no message of a flight: it was cut off at its beginning; fetch it again, or "
            "copy it from the vehicle's card"
        )
    span = (float(joined.min()), float(joined.max()))
    damage = f"{lost} of its {len(content)} bytes could not be read" if lost else ""
    return VehicleLog("ArduPilot", span, topics, texts, damage)


def _tables(
    content: bytes | memoryview,
) -> tuple[dict[str, _Table], dict[str, dict[str, float]], int]:
    """The wanted messages by name, the scales of their fields, and the bytes that were lost."""
    data = bytes(content)
    formats: dict[int, _Format] = {_FMT: _Format("FMT", _FMT_SIZE, "", ())}
    places: dict[int, list[int]] = defaultdict(list)
    at = lost = 0
    trusted = True
    while at + 3 <= len(data):
        known = formats.get(data[at + 2]) if data[at : at + 2] == _MARK else None
        # After a gap the mark may be chance: what follows has to begin with one, too.
        if known is None or (not trusted and not _followed(data, at + known.size)):
            following = data.find(_MARK, at + 1)
            following = len(data) if following < 0 else following
            lost += following - at
            at, trusted = following, False
            continue
        trusted = True
        if at + known.size > len(data):
            break
        if known.name == "FMT":
            kind, told = _Format.unpack(data[at + 3 : at + known.size])
            if told is not None:
                formats.setdefault(kind, told)
        elif known.name in _WANTED and known.sound:
            places[data[at + 2]].append(at)
        elif known.name in _WANTED:
            lost += known.size
        at += known.size
    # Most end within a message, for the autopilot writes whole blocks: that is no damage.
    raw = np.frombuffer(data, np.uint8)
    tables: dict[str, _Table] = {}
    scales: dict[str, dict[str, float]] = {}
    for kind, starts in places.items():
        told = formats[kind]
        body = raw[np.array(starts)[:, None] + np.arange(3, told.size)]
        tables[told.name] = np.ascontiguousarray(body).view(told.dtype)[:, 0]
        scales[told.name] = {
            column: _SCALES[letter]
            for column, letter in zip(told.columns, told.letters, strict=True)
            if letter in _SCALES
        }
    return tables, scales, lost


def _followed(data: bytes, at: int) -> bool:
    return at == len(data) or data[at : at + 2] == _MARK


def _series(
    table: _Table | None,
    scales: Mapping[str, Mapping[str, float]],
    message: str,
    columns: Mapping[str, tuple[str, float]],
) -> Series | None:
    """The columns of a message's first instance; None if it lacks one of them."""
    names = () if table is None else table.dtype.names or ()
    if table is None or not {"TimeUS", *(field for field, _ in columns.values())} <= set(names):
        return None
    for column in _INSTANCES:
        if column in names:
            table = table[table[column] == table[column].min()]
            break
    scale = scales[message]
    values = {
        name: sign * scale.get(field, 1.0) * table[field].astype(np.float64)
        for name, (field, sign) in columns.items()
    }
    return Series(_seconds(table), values)


def _motors(tables: Mapping[str, _Table]) -> Series | None:
    """Each motor's share of its PWM range, by the channels that drive motors."""
    table = tables.get("RCOU")
    if table is None or "TimeUS" not in (table.dtype.names or ()):
        return None
    parameters = _parameters(tables)
    told = {
        int(parameters[f"SERVO{n}_FUNCTION"]): n
        for n in range(1, _SERVOS + 1)
        if parameters.get(f"SERVO{n}_FUNCTION") in _MOTORS
    }
    names = table.dtype.names or ()
    channels = [told[function] for function in sorted(told) if f"C{told[function]}" in names]
    if not channels:
        return None
    low, high = (
        parameters.get(f"MOT_PWM_{n}") or at for n, at in zip(("MIN", "MAX"), _PWM, strict=True)
    )
    span = high - low if high > low else _PWM[1] - _PWM[0]
    columns = {
        f"motor {number}": 100.0 * (table[f"C{channel}"].astype(np.float64) - low) / span
        for number, channel in enumerate(channels, 1)
    }
    return Series(_seconds(table), columns)


def _parameters(tables: Mapping[str, _Table]) -> dict[str, float]:
    table = tables.get("PARM")
    if table is None or not {"Name", "Value"} <= set(table.dtype.names or ()):
        return {}
    return {
        _text(name): float(value) for name, value in zip(table["Name"], table["Value"], strict=True)
    }


def _messages(tables: Mapping[str, _Table]) -> Iterable[LogText]:
    table = tables.get("MSG")
    if table is not None and {"TimeUS", "Message"} <= set(table.dtype.names or ()):
        for time, text in zip(_seconds(table), table["Message"], strict=True):
            yield LogText(float(time), _text(text))


def _errors(tables: Mapping[str, _Table]) -> Iterable[LogText]:
    table = tables.get("ERR")
    if table is not None and {"TimeUS", "Subsys", "ECode"} <= set(table.dtype.names or ()):
        for time, part, code in zip(_seconds(table), table["Subsys"], table["ECode"], strict=True):
            yield LogText(float(time), f"ERR of subsystem {part}, code {code}", "error")


def _seconds(table: _Table) -> Floats:
    seconds: Floats = table["TimeUS"].astype(np.float64) / _MICROSECONDS
    return seconds


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("utf-8", "replace")

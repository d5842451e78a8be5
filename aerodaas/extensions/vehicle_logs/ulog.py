"""PX4's ULog files (`.ulg`), by pyulog.

The format: https://docs.px4.io/main/en/dev_log/ulog_file_format.html.
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from aerodaas.config.extras import require_extra
from aerodaas.errors import RecordingError
from aerodaas.extensions.vehicle_logs.log import Floats, LogText, Series, Topic, VehicleLog

if TYPE_CHECKING:
    from pyulog import ULog

__all__ = ["ULOG_HEAD", "read_ulog"]

ULOG_HEAD = b"ULog\x01\x12\x35"
"""First bytes of a log."""

_MICROSECONDS = 1e6
_WIDEST = 0xFFFF
"""Bytes of the longest message that the format can write."""
_SIZES = {
    **dict.fromkeys(("int8_t", "uint8_t", "bool", "char"), 1),
    **dict.fromkeys(("int16_t", "uint16_t"), 2),
    **dict.fromkeys(("int32_t", "uint32_t", "float"), 4),
    **dict.fromkeys(("int64_t", "uint64_t", "double"), 8),
}
_MOST_MOTORS = 12
_NOT_MEASURED = -1.0
_SEVERITIES = {ord("2"): "critical", ord("3"): "error", ord("4"): "warning", ord("5"): "notice"}
_SEVERITIES |= {ord("0"): "emergency", ord("1"): "alert"}

_Data = Mapping[str, Floats]
_Columns = Callable[[_Data], dict[str, Floats]]


def read_ulog(file: Path) -> VehicleLog:
    """Read a log; what is broken in it is left out and told.

    Raises:
        ConfigError: Without the extra `logs`.
        RecordingError: If it holds no message with a time.
    """
    require_extra("logs", "a log of PX4")
    from pyulog import ULog  # noqa: PLC0415 - needs the extra

    wanted = sorted({message for _, message, _ in _TOPICS})
    try:
        # It prints what it finds broken.
        with contextlib.redirect_stdout(io.StringIO()):
            _check_formats(ULog(str(file), parse_header_only=True))
            ulog = ULog(str(file), message_name_filter_list=wanted)
    except Exception as error:  # noqa: BLE001 - its reader raises what a broken file brings about
        raise RecordingError(f"is no ULog that can be read ({error}); fetch it again") from None
    found: dict[str, _Data] = {}
    for part in ulog.data_list:
        found.setdefault(part.name, part.data)
    topics: dict[Topic, Series] = {}
    for topic, message, columns in _TOPICS:
        data = found.get(message)
        if data is None or topic in topics:
            continue
        with contextlib.suppress(KeyError):  # another version's fields
            topics[topic] = Series(data["timestamp"] / _MICROSECONDS, columns(data))
    if not topics:
        raise RecordingError(
            "holds none of the topics of a flight: it was cut off at its beginning, or the logging "
            "profile (SDLOG_PROFILE) leaves them out; fetch it again"
        )
    times = np.concatenate([one.time for one in topics.values()])
    texts = tuple(
        LogText(
            one.timestamp / _MICROSECONDS, one.message.strip(), _SEVERITIES.get(one.log_level, "")
        )
        for one in ulog.logged_messages
    )
    return VehicleLog("PX4", (float(times.min()), float(times.max())), topics, texts, _damage(ulog))


def _damage(ulog: ULog) -> str:
    told = ["parts of it could not be read"] if ulog.file_corruption else []
    if ulog.dropouts:
        lost = sum(one.duration for one in ulog.dropouts) / 1000.0
        told.append(f"the autopilot's card was too slow {len(ulog.dropouts)} times ({lost:.1f} s)")
    return "; ".join(told)


def _check_formats(header: ULog) -> None:
    """Refuse formats that unfold to more than any message holds; raises ValueError.

    The reader makes a name for each element of arrays within arrays.
    """
    widths: dict[str, int] = dict(_SIZES)

    def width(name: str, within: tuple[str, ...]) -> int:
        if name not in widths:
            if name in within or name not in header.message_formats:
                raise ValueError(f"the format {name[:40]!r} is not defined")
            total = 0
            for kind, count, _ in header.message_formats[name].fields:
                total += max(1, count) * width(kind, (*within, name))
                if total > _WIDEST:
                    raise ValueError(f"the format {name[:40]!r} is longer than any message")
            widths[name] = total
        return widths[name]

    for name in header.message_formats:
        width(name, ())


def _velocity(data: _Data) -> dict[str, Floats]:
    north, east, down = (data[axis].astype(np.float64) for axis in ("vx", "vy", "vz"))
    return {"east": east, "north": north, "up": -down}


def _vibration(data: _Data) -> dict[str, Floats]:
    return {"all axes": data["accel_vibration_metric"].astype(np.float64)}


def _angles(prefix: str) -> _Columns:
    """Roll, pitch and heading in degrees of a quaternion (w, x, y, z) from FRD to NED."""

    def columns(data: _Data) -> dict[str, Floats]:
        w, x, y, z = (data[f"{prefix}[{place}]"].astype(np.float64) for place in range(4))
        roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0))
        heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        return {
            "roll": np.degrees(roll),
            "pitch": np.degrees(pitch),
            "heading": np.degrees(heading) % 360.0,
        }

    return columns


def _battery(data: _Data) -> dict[str, Floats]:
    """Voltage and current; -1 A is one that is not measured."""
    current = data["current_a"].astype(np.float64)
    return {
        "voltage": data["voltage_v"].astype(np.float64),
        "current": np.where(current == _NOT_MEASURED, np.nan, current),
    }


def _motors(data: _Data) -> dict[str, Floats]:
    """Percent of full thrust of the motors that are used; the others have NaN."""
    columns: dict[str, Floats] = {}
    for number in range(_MOST_MOTORS):
        control = data[f"control[{number}]"].astype(np.float64)
        if np.isfinite(control).any():
            columns[f"motor {number + 1}"] = 100.0 * control
    return columns


_TOPICS: tuple[tuple[Topic, str, _Columns], ...] = (
    ("battery", "battery_status", _battery),
    ("attitude", "vehicle_attitude", _angles("q")),
    ("attitude setpoint", "vehicle_attitude_setpoint", _angles("q_d")),
    ("velocity", "vehicle_local_position", _velocity),
    ("vibration", "vehicle_imu_status", _vibration),
    ("motors", "actuator_motors", _motors),
)
"""Topic, message, and how its columns come from the fields of the message's first instance."""

"""Logs of ArduPilot and PX4: their main topics, whole, cut, damaged, foreign."""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

import flown_logs
import numpy as np
import pytest
from flown_logs import Flown, dataflash, ulog
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import DFReader

from aerodaas.errors import ConfigError, RecordingError
from aerodaas.extensions.vehicle_logs import reading
from aerodaas.extensions.vehicle_logs.log import VehicleLog
from aerodaas.extensions.vehicle_logs.reading import read_vehicle_log

FLOWN = Flown()
Write = Callable[..., bytes]


def read(folder: Path, content: bytes) -> VehicleLog:
    """The log in a file."""
    file = folder / "log"
    file.write_bytes(content)
    return read_vehicle_log(file)


def firsts(log: VehicleLog) -> dict[str, dict[str, float]]:
    """The first known value of each column."""
    return {
        topic: {
            name: round(float(values[np.isfinite(values)][0]), 3)
            for name, values in series.columns.items()
        }
        for topic, series in log.topics.items()
    }


COMMON = {
    "battery": {"voltage": 15.2, "current": 11.0},
    "velocity": {"east": 4.0, "north": 0.0, "up": 0.0},
}


def test_the_topics_of_ardupilot(tmp_path: Path) -> None:
    """In our units and axes, of the first instance; motors by their functions, in PWM's range."""
    log = read(tmp_path, dataflash(FLOWN))
    assert log.autopilot == "ArduPilot"
    assert firsts(log) == {
        **COMMON,
        "attitude": {"roll": 1.0, "pitch": -2.0, "heading": 89.5},
        "attitude setpoint": {"roll": 1.1, "pitch": -2.1, "heading": 90.0},
        "vibration": {"x": 3.0, "y": 4.0, "z": 5.0},
        "motors": {"motor 1": 25.0, "motor 2": 50.0},
    }
    assert log.topics["battery"].time[:2] == pytest.approx([42.0, 42.1], abs=1e-4)
    assert log.span == pytest.approx((42.0, 102.003), abs=1e-3)
    assert [(text.text, text.severity) for text in log.texts] == [
        ("ArduCopter V4.7.0", ""),
        ("ERR of subsystem 16, code 2", "error"),
    ]
    assert log.damage == ""


def test_the_topics_of_px4(tmp_path: Path) -> None:
    """In the same units and axes; motors that are not used are left out."""
    log = read(tmp_path, ulog(FLOWN))
    assert log.autopilot == "PX4"
    assert firsts(log) == {
        **COMMON,
        "attitude": {"roll": 30.0, "pitch": 0.0, "heading": 0.0},
        "attitude setpoint": {"roll": 0.0, "pitch": 30.0, "heading": 0.0},
        "vibration": {"all axes": 4.5},
        "motors": {"motor 1": 50.0, "motor 2": 25.0},
    }
    assert log.topics["motors"].time[:2] == pytest.approx([42.0, 42.1], abs=1e-4)
    assert [(text.text, text.severity) for text in log.texts] == [("Landing detected", "warning")]
    assert log.damage == ""


def test_a_current_that_is_not_measured_is_none(tmp_path: Path) -> None:
    """PX4 writes -1 for it."""
    battery = read(tmp_path, ulog(FLOWN, current=-1.0)).topics["battery"].columns
    assert np.isnan(battery["current"]).all()
    assert battery["voltage"][0] == pytest.approx(15.2)


def test_the_same_as_by_pymavlink(tmp_path: Path) -> None:
    """Every value of a message, by ArduPilot's own reader."""
    log = read(tmp_path, dataflash(FLOWN))
    reader = DFReader.DFReader_binary(str(tmp_path / "log"))
    rows = []
    while (message := reader.recv_match(type="ATT")) is not None:
        rows.append((message.TimeUS / 1e6, message.Roll, message.Pitch, message.Yaw))
    series = log.topics["attitude"]
    ours = np.column_stack(
        [series.time, *(series.columns[one] for one in ("roll", "pitch", "heading"))]
    )
    assert len(rows) == 600
    assert ours == pytest.approx(np.array(rows))


@pytest.mark.parametrize("write", [dataflash, ulog])
def test_a_log_that_was_cut_is_read_as_far_as_it_goes(tmp_path: Path, write: Write) -> None:
    """The autopilot lost its power: in the midst of a message."""
    whole = write(FLOWN)
    log = read(tmp_path, whole[: len(whole) // 2 + 1])
    times = log.topics["attitude"].time
    assert log.damage == ""
    assert times[0] == pytest.approx(42.0, abs=1e-3)
    assert 25.0 < times[-1] - times[0] < 35.0


def test_damage_in_the_midst_costs_what_it_covers(tmp_path: Path) -> None:
    """And is told, however much it looks like messages."""
    whole = bytearray(dataflash(FLOWN))
    middle = len(whole) // 2
    whole[middle : middle + 2000] = b"\xa3\x95\x14\x00" * 500
    log = read(tmp_path, bytes(whole))
    roll = log.topics["attitude"].columns["roll"]
    assert 580 < len(roll) < 600
    assert set(roll.tolist()) == {1.0}
    lost = int(log.damage.split()[0])
    assert 2000 <= lost < 2200


def test_figures_that_no_vehicle_has_are_left_out(tmp_path: Path) -> None:
    """A plot would show nothing beside them."""
    whole = bytearray(dataflash(FLOWN))
    at = whole.index(b"\xa3\x95\x13", 5000) + 3 + 9
    whole[at : at + 4] = np.float32(3e30).tobytes()
    voltage = read(tmp_path, bytes(whole)).topics["battery"].columns["voltage"]
    assert np.isnan(voltage).sum() == 1
    assert np.nanmax(voltage) < 16.0


@given(st.sampled_from([dataflash, ulog]), st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_whatever_a_file_holds_it_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, write: Write, random: Random
) -> None:
    """A recording's attachment may be a stranger's: no other error comes of it."""
    content = bytearray(write(Flown(duration=2.0)))
    for _ in range(random.randint(1, 20)):
        at = random.randrange(8, len(content))
        change = random.choice([b"", b"\xff", random.randbytes(9)])
        content[at : at + random.choice([0, 1, 40])] = change
    try:
        log = read(tmp_path_factory.mktemp("log"), bytes(content))
    except RecordingError:
        return
    for series in log.topics.values():
        assert {len(one) for one in series.columns.values()} == {len(series.time)}
        assert all(np.nanmax(np.abs(one), initial=0.0) <= 1e8 for one in series.columns.values())


def described(kind: int, name: str, letters: str, columns: str) -> bytes:
    """A FMT, and a message of its kind."""
    size = 3 + sum({"Q": 8, "f": 4, "Z": 64, "a": 64}[one] for one in letters)
    words = [one.encode() for one in (name, letters, columns)]
    told = struct.pack("<BB4s16s64s", kind, size, *words)
    return b"\xa3\x95\x80" + told + bytes((0xA3, 0x95, kind)) + b"x" * (size - 3)


@pytest.mark.parametrize(
    ("name", "letters", "columns"),
    [
        ("BAT", "ZffQ", "TimeUS,Volt,Curr,x"),
        ("BAT", "fff", "TimeUS,Volt,Curr"),
        ("BAT", "QZf", "TimeUS,Volt,Curr"),
        ("VIBE", "QZfff", "TimeUS,IMU,VibeX,VibeY,VibeZ"),
        ("VIBE", "Qafff", "TimeUS,IMU,VibeX,VibeY,VibeZ"),
        ("MSG", "Qf", "TimeUS,Message"),
        ("PARM", "Qff", "TimeUS,Name,Value"),
        ("MSG", "", ""),
    ],
)
def test_fields_of_another_kind_cost_their_messages(
    tmp_path: Path, name: str, letters: str, columns: str
) -> None:
    """Texts where numbers belong, numbers where texts do, or nothing at all; it is told."""
    strange = described(0x50, name, letters, columns)
    whole = dataflash(FLOWN)
    log = read(tmp_path, whole[:89] + strange + whole[89:])
    assert firsts(log)["attitude"]["roll"] == 1.0
    size = len(strange) - 89
    assert log.damage.startswith(f"{size} of its ")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty: the vehicle wrote no log"),
        (b"\xfe\x09\x00\x01\x01" * 50, "is no log of an autopilot: neither DataFlash"),
        (dataflash(FLOWN)[:500], "cut off at its beginning; fetch it again"),
        (b"\xa3\x95\x80" + bytes(5000), "cut off at its beginning; fetch it again"),
        (ulog(FLOWN)[:300], "cut off at its beginning, or the logging profile"),
        (ulog(FLOWN)[:9], "is no ULog that can be read"),
    ],
)
def test_what_is_no_log_of_a_flight_is_refused(tmp_path: Path, content: bytes, said: str) -> None:
    """With what it is and the remedy."""
    with pytest.raises(RecordingError, match=f"log.* {said}"):
        read(tmp_path, content)


@pytest.mark.parametrize(
    "extra",
    ["a:uint64_t timestamp;b[1000] x;", "a:uint64_t timestamp;a x;", "a:float[60000] x;"],
)
def test_formats_that_unfold_without_end_are_refused(tmp_path: Path, extra: str) -> None:
    """Before a name is made for each of their elements."""
    whole = ulog(FLOWN, extra=extra)
    head = len(b"ULog\x01\x12\x35\x01") + 8 + 3 + 40
    told = b"b:uint64_t[1000] x;"
    nested = len(told).to_bytes(2, "little") + b"F" + told
    with pytest.raises(RecordingError, match=r"can be read .*format"):
        read(tmp_path, whole[:head] + nested + whole[head:])


def test_a_log_that_is_too_large_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before it is read into memory."""
    monkeypatch.setattr(reading, "MAX_LOG", 1000)
    with pytest.raises(RecordingError, match="more than the 1000 of a log that is read"):
        read(tmp_path, dataflash(FLOWN))


def test_px4_needs_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """ArduPilot needs nothing."""
    monkeypatch.setitem(sys.modules, "pyulog", None)
    assert read(tmp_path, dataflash(FLOWN)).topics
    with pytest.raises(ConfigError, match=r"needs pyulog: pip install 'aerodaas\[logs\]'"):
        read(tmp_path, ulog(FLOWN))


def test_times_that_are_no_numbers_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A ULog says itself of which type its timestamps are; nothing can be laid over a mission."""
    formats = {
        name: fields.replace("uint64_t timestamp", "double timestamp")
        for name, fields in flown_logs._ULOG.items()
    }
    monkeypatch.setattr(flown_logs, "_ULOG", formats)
    monkeypatch.setattr(flown_logs, "_us", lambda *_: 0x7FF8 << 48)  # NaN
    with pytest.raises(RecordingError, match="holds times that are no numbers"):
        read(tmp_path, ulog(FLOWN))

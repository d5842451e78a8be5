"""Logs fetched as files, by MAVLink FTP: whole, compared by checksum, gone on with when cut."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from emulated import Flight, Stepped

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.vehicle_logs.log_service import LogEntry
from aerodaas.extensions.vehicle_logs.mavlink_logs import MavlinkLogs
from aerodaas.testing.channel import Impairment
from tools.mavlink_vehicle import AutopilotOptions

DATAFLASH = b"\xa3\x95\x80" + random.Random(1).randbytes(100_000)
BEGAN = 1_800_000_000.0
LOG = LogEntry(2, len(DATAFLASH), BEGAN)
PATH = "/APM/LOGS/00000007.BIN"
NAME = "log-2-20270115-080000.bin"
PART = "log-2-100003.part"
ARDUPILOT = AutopilotOptions(family="ardupilot", ready_after=0.0)


@pytest.fixture
def pair(flight: Flight) -> Iterator[Stepped]:
    """A vehicle on the ground with two logs, as numbers and as files."""
    with flight(ARDUPILOT) as ends:
        ends.watch(1.0)
        ends.firmware.files.files = {
            "/APM/LOGS/00000006.BIN": DATAFLASH[:90],
            PATH: DATAFLASH,
            "/APM/LOGS/LASTLOG.TXT": b"7\n",
        }
        ends.firmware.logs.logs = {1: DATAFLASH[:90], 2: DATAFLASH}
        ends.vehicle.telemetry.serves_files = True
        ends.autopilot.heard.clear()
        yield ends


@pytest.fixture
def logs(pair: Stepped) -> MavlinkLogs:
    """The log service of that vehicle."""
    return MavlinkLogs(pair.vehicle)


def begins(pair: Stepped) -> list[int]:
    """From which bytes on bursts were asked for."""
    payloads = [bytes(one.payload) for one in pair.heard("FILE_TRANSFER_PROTOCOL")]
    burst = mavlink.MAV_FTP_OPCODE_BURSTREADFILE
    return [int.from_bytes(one[8:12], "little") for one in payloads if one[3] == burst]


def test_a_log_is_fetched_as_a_file(pair: Stepped, logs: MavlinkLogs, tmp_path: Path) -> None:
    """Found by its size, named after its number; progress is told, and the session ends."""
    told: list[tuple[int, int]] = []
    file = logs.fetch_log(LOG, tmp_path / "new", lambda *done: told.append(done))
    assert file == tmp_path / "new" / NAME
    assert file.read_bytes() == DATAFLASH
    assert [one.name for one in file.parent.iterdir()] == [NAME]
    assert told[0] == (0, 100_003)
    assert told[-1] == (100_003, 100_003)
    assert told == sorted(told)
    assert len(told) == 5
    assert not pair.heard("LOG_REQUEST_DATA")
    terminate = mavlink.MAV_FTP_OPCODE_TERMINATESESSION
    pair.wait(lambda: any(one.payload[3] == terminate for one in pair.heard(KIND)))


KIND = "FILE_TRANSFER_PROTOCOL"


def test_lost_doubled_and_overtaken_packets(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path
) -> None:
    """A twentieth of them, both ways."""
    bad = Impairment(loss=0.05, duplicates=0.05, jitter=0.02)
    pair.autopilot.spoil(up=bad, down=bad)
    assert logs.fetch_log(LOG, tmp_path).read_bytes() == DATAFLASH
    assert not pair.heard("LOG_REQUEST_DATA")


def cut_at(pair: Stepped, byte: int) -> Callable[[int, int], None]:
    """The vehicle goes away once so many bytes have come."""
    return lambda done, _: pair.autopilot.cut() if done >= byte else None


def test_a_vehicle_that_goes_away_and_comes_back(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path
) -> None:
    """What came is kept, and the next fetch goes on from there."""
    with pytest.raises(VehicleError, match=r"stopped sending .* next fetch goes on from .*part"):
        logs.fetch_log(LOG, tmp_path, cut_at(pair, 40_000))
    (part,) = tmp_path.iterdir()
    held = part.stat().st_size
    assert 40_000 <= held < len(DATAFLASH)
    assert part.read_bytes() == DATAFLASH[:held]

    pair.autopilot.spoil(up=Impairment(), down=Impairment())
    pair.wait(lambda: not pair.vehicle.preflight())
    pair.autopilot.heard.clear()
    later = replace(LOG, began=BEGAN + 60.0)
    assert logs.fetch_log(later, tmp_path).read_bytes() == DATAFLASH
    assert [one.name for one in tmp_path.iterdir()] == ["log-2-20270115-080100.bin"]
    assert begins(pair)[0] == held


@pytest.mark.parametrize("held", [b"\xff" * 50_000, b"\xff" * 200_000])
def test_what_is_held_of_another_log_is_fetched_anew(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, held: bytes
) -> None:
    """The vehicle's checksum tells it, or its size does."""
    (tmp_path / PART).write_bytes(held)
    assert logs.fetch_log(LOG, tmp_path).read_bytes() == DATAFLASH
    assert 0 in begins(pair)


def test_a_checksum_that_does_not_fit(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No file is better than a wrong one."""
    monkeypatch.setattr(pair.firmware.files, "checksum", lambda _: 1)
    with pytest.raises(VehicleError, match="has another checksum on the vehicle"):
        logs.fetch_log(LOG, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_without_checksums_nothing_is_gone_on_with(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It comes whole, once more: what was held may be anything."""
    server, crc = pair.firmware.files, mavlink.MAV_FTP_OPCODE_CALCFILECRC
    whole = server.answer

    def unsummed(payload: bytes) -> list[bytes]:
        if payload[3] != crc:
            return whole(payload)
        (reply,) = whole(payload[:3] + b"\x63" + payload[4:])
        return [reply[:5] + bytes([crc]) + reply[6:]]

    monkeypatch.setattr(server, "answer", unsummed)
    assert logs.fetch_log(LOG, tmp_path).read_bytes() == DATAFLASH
    (tmp_path / PART).write_bytes(b"\xff" * 99_000)
    assert logs.fetch_log(LOG, tmp_path).read_bytes() == DATAFLASH


def test_a_path_out_of_the_folder_is_not_gone(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is no file of ours; the log comes by its number, into the folder."""
    ways = [
        f"F../../../{name}.bin\t{len(DATAFLASH)}".encode() for name in ("x", "APM/LOGS/00000007")
    ]
    monkeypatch.setattr(pair.firmware.files, "listing", lambda _: ways)
    folder = tmp_path / "a" / "b" / "c" / "d"
    file = logs.fetch_log(LOG, folder)
    assert file == folder / NAME
    assert [one for one in tmp_path.rglob("*") if one.is_file()] == [file]
    assert pair.heard("LOG_REQUEST_DATA")
    assert not begins(pair)


def no_service(pair: Stepped) -> None:
    """It has told of none."""
    pair.vehicle.telemetry.serves_files = False


def twins(pair: Stepped) -> None:
    """Two of one size."""
    pair.autopilot.firmware.files.files["/APM/LOGS/00000008.BIN"] = DATAFLASH[::-1]


def written(pair: Stepped) -> None:
    """It has grown since it was listed."""
    pair.autopilot.firmware.files.files[PATH] = DATAFLASH + b"more"


def silent(pair: Stepped) -> None:
    """It says that it has the service, and does not answer."""
    pair.firmware.files.answer = lambda _: []  # type: ignore[method-assign]


@pytest.mark.parametrize("lacks", [no_service, twins, written, silent])
def test_without_a_file_that_is_certainly_it_comes_by_its_number(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, lacks: Callable[[Stepped], None]
) -> None:
    """As ever."""
    lacks(pair)
    assert logs.fetch_log(LOG, tmp_path).read_bytes() == DATAFLASH
    assert pair.heard("LOG_REQUEST_DATA")
    assert not begins(pair)


@pytest.mark.parametrize("files", [True, False])
def test_a_pilot_takes_off_in_between(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path, *, files: bool
) -> None:
    """The link is needed: no more is asked for, whichever way it comes."""
    pair.vehicle.telemetry.serves_files = files
    connection = pair.vehicle.connection

    def arm(done: int, _: int) -> None:
        if done >= 30_000:
            connection.commander.give(connection.autopilot.arm(), now=pair.now)
            pair.wait(lambda: pair.vehicle.read().armed)

    with pytest.raises(VehicleError, match="cannot fetch logs in flight"):
        logs.fetch_log(LOG, tmp_path, arm)
    asked = begins(pair) if files else [one.ofs for one in pair.heard("LOG_REQUEST_DATA")]
    assert asked
    assert max(asked) < 72_000
    connection.commander.give(connection.autopilot.disarm(), now=pair.now)
    pair.wait(lambda: not pair.vehicle.read().armed)


def test_px4_has_a_folder_for_each_day(flight: Flight, tmp_path: Path) -> None:
    """On its card."""
    ulog = b"ULog\x01\x12\x35" + random.Random(2).randbytes(5_000)
    with flight() as pair:
        pair.autopilot.firmware.files.files = {
            "/fs/microsd/log/2027-01-14/07_00_00.ulg": ulog[:90],
            "/fs/microsd/log/2027-01-15/08_00_00.ulg": ulog,
        }
        file = MavlinkLogs(pair.vehicle).fetch_log(LogEntry(0, len(ulog), None), tmp_path)
        assert not pair.heard("LOG_REQUEST_DATA")
    assert file.name == "log-0.ulg"
    assert file.read_bytes() == ulog

"""The autopilot's own logs: listed, fetched whole or not at all, on the ground."""

from __future__ import annotations

import json
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import pytest
from emulated import LOOPBACK, Flight, Stepped
from flown_logs import EPOCH, Flown, dataflash, record_flown, ulog

from aerodaas.cli.app import main
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.extensions.vehicle_logs.log_service import LogEntry
from aerodaas.extensions.vehicle_logs.mavlink_logs import MavlinkLogs
from aerodaas.recording.reader import Recording
from aerodaas.testing.channel import Impairment
from tools.mavlink_vehicle import AutopilotOptions
from tools.mavlink_vehicle.store import LogStore

DATAFLASH = b"\xa3\x95\x80" + random.Random(1).randbytes(100_000)
ULOG = b"ULog\x01\x12\x35" + random.Random(2).randbytes(5_000)
BEGAN = 1_800_000_000.0
ARDUPILOT = AutopilotOptions(family="ardupilot", ready_after=0.0)


@pytest.fixture
def pair(flight: Flight) -> Iterator[Stepped]:
    """A vehicle on the ground with two logs."""
    with flight(ARDUPILOT) as ends:
        ends.watch(1.0)
        ends.firmware.logs = LogStore()
        ends.firmware.logs.logs = {1: DATAFLASH[:90], 2: DATAFLASH}
        yield ends


@pytest.fixture
def logs(pair: Stepped) -> MavlinkLogs:
    """The log service of that vehicle."""
    return MavlinkLogs(pair.vehicle)


def test_the_list(pair: Stepped, logs: MavlinkLogs) -> None:
    """Numbers, sizes and times, of ArduPilot those of the last writing; of none it is empty."""
    ended = BEGAN
    assert logs.logs() == [LogEntry(1, 90, None, ended), LogEntry(2, 100_003, None, ended)]
    pair.autopilot.firmware.logs.logs = {}
    assert logs.logs() == []


def test_a_log_is_fetched_whole(pair: Stepped, logs: MavlinkLogs, tmp_path: Path) -> None:
    """Byte by byte, in a file named after its number and time; progress is told."""
    told: list[tuple[int, int]] = []
    log = logs.logs()[1]
    file = logs.fetch_log(log, tmp_path / "new", lambda *done: told.append(done))
    assert file.name == "log-2-20270115-080000.bin"
    assert file.read_bytes() == DATAFLASH
    assert told == [(36_000, 100_003), (72_000, 100_003), (100_003, 100_003)]
    pair.wait(lambda: bool(pair.heard("LOG_REQUEST_END")))


def test_px4_has_its_own_format(flight: Flight, tmp_path: Path) -> None:
    """ULog, numbered from zero."""
    with flight() as pair:
        pair.autopilot.firmware.logs.logs = {0: ULOG}
        (log,) = MavlinkLogs(pair.vehicle).logs()
        assert (log.began, log.ended) == (None, BEGAN)
        pair.vehicle.telemetry.software = "1.15.4.255"
        (older,) = MavlinkLogs(pair.vehicle).logs()
        assert (older.began, older.ended) == (BEGAN, None)
        file = MavlinkLogs(pair.vehicle).fetch_log(log, tmp_path)
    assert file.suffix == ".ulg"
    assert file.read_bytes() == ULOG


def stalls(message: Any) -> Any:  # noqa: ANN401
    """Nothing after a while."""
    return message if getattr(message, "ofs", 0) < 40_000 else None


def ends(message: Any) -> Any:  # noqa: ANN401
    """Shorter than it was said to be."""
    if message.get_type() != "LOG_DATA" or message.ofs != 900:
        return message
    return mavlink.MAVLink_log_data_message(message.id, 900, 10, message.data)


def forgets(message: Any) -> Any:  # noqa: ANN401
    """The second one of the list."""
    return None if message.get_type() == "LOG_ENTRY" and message.id == 2 else message


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (stalls, "stopped sending log 2 at byte 40050 of 100003"),
        (ends, "ends at byte 910, and was said to have 100003"),
        (forgets, "told 1 of its 2 logs only"),
        (lambda _: None, "does not answer when asked for its logs"),
    ],
)
def test_what_goes_wrong_is_said_and_leaves_no_file(
    monkeypatch: pytest.MonkeyPatch,
    pair: Stepped,
    logs: MavlinkLogs,
    tmp_path: Path,
    spoil: Callable[[Any], Any],
    said: str,
) -> None:
    """Neither half a log, nor an endless wait."""
    store = pair.firmware.logs
    whole = store.handle

    def handle(message: Any) -> list[Any]:  # noqa: ANN401 - pymavlink has no types
        answers = map(spoil, whole(message))
        return [answer for answer in answers if answer is not None]

    monkeypatch.setattr(store, "handle", handle)
    with pytest.raises(VehicleError, match=said):
        logs.fetch_log(logs.logs()[1], tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_log_is_told_and_kept(pair: Stepped, logs: MavlinkLogs, tmp_path: Path) -> None:
    """Somebody may mend it."""
    pair.autopilot.firmware.logs.logs = {1: b"\xff" * 500}
    with pytest.raises(VehicleError, match="is no log of ArduPilot"):
        logs.fetch_log(logs.logs()[0], tmp_path)
    (file,) = tmp_path.iterdir()
    assert file.read_bytes() == b"\xff" * 500


@pytest.mark.parametrize("size", [0, 5 << 30])
def test_a_size_that_cannot_be_is_refused(logs: MavlinkLogs, tmp_path: Path, size: int) -> None:
    """Before the disk is full."""
    with pytest.raises(VehicleError, match="none to be fetched"):
        logs.fetch_log(LogEntry(1, size, None), tmp_path)


def test_not_in_flight(pair: Stepped, logs: MavlinkLogs, tmp_path: Path) -> None:
    """Setpoints and telemetry need the link."""
    connection = pair.vehicle.connection
    connection.commander.give(connection.autopilot.arm(), now=pair.now)
    pair.wait(lambda: pair.vehicle.read().armed)
    for deed in (
        logs.logs,
        lambda: logs.fetch_log(LogEntry(1, 90, None), tmp_path),
    ):
        with pytest.raises(VehicleError, match="in flight"):
            deed()
    connection.commander.give(connection.autopilot.disarm(), now=pair.now)
    pair.wait(lambda: not pair.vehicle.read().armed)


def test_a_pilot_takes_off_in_between(pair: Stepped, logs: MavlinkLogs, tmp_path: Path) -> None:
    """The link is needed: no more is asked for."""
    connection = pair.vehicle.connection

    def arm(done: int, _: int) -> None:
        if done >= 30_000:
            connection.commander.give(connection.autopilot.arm(), now=pair.now)
            pair.wait(lambda: pair.vehicle.read().armed)

    with pytest.raises(VehicleError, match="cannot fetch logs in flight"):
        logs.fetch_log(LogEntry(2, len(DATAFLASH), BEGAN), tmp_path, arm)
    assert max(one.ofs for one in pair.heard("LOG_REQUEST_DATA")) < 72_000
    connection.commander.give(connection.autopilot.disarm(), now=pair.now)
    pair.wait(lambda: not pair.vehicle.read().armed)


def test_lost_doubled_and_overtaken_packets(
    pair: Stepped, logs: MavlinkLogs, tmp_path: Path
) -> None:
    """A twentieth of them, both ways."""
    bad = Impairment(loss=0.05, duplicates=0.05, jitter=0.02)
    pair.autopilot.spoil(up=bad, down=bad)
    log = LogEntry(2, len(DATAFLASH), BEGAN)
    assert logs.fetch_log(log, tmp_path).read_bytes() == DATAFLASH


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str]]:
    """The command in a folder of its own: exit code and output."""
    monkeypatch.chdir(tmp_path)

    def ran(*words: str) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["aerodaas", "logs", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        told = capsys.readouterr()
        return int(ended.value.code or 0), told.out + told.err

    return ran


def test_on_the_command_line(
    flight: Flight, tmp_path: Path, run: Callable[..., tuple[int, str]]
) -> None:
    """A list, the newest one, and a number that there is not."""
    ends = flight(AutopilotOptions(family="ardupilot"))
    settings = {"url": f"udpin:{LOOPBACK}:{ends.port}", "fallback": "ignore", "failsafes": "ignore"}
    drone = {"id": "drone", "driver": "mavlink", "settings": settings}
    robots = [drone, {"id": "other"}]
    (tmp_path / "environment.json").write_text(json.dumps({"robots": robots}))

    with ends.unconnected():
        autopilot = ends.autopilot
        autopilot.firmware.logs.logs = {1: DATAFLASH[:90], 2: DATAFLASH}
        code, told = run("list", "drone")
        assert code == 0, told
        assert "2027-01-15 08:00:00 UTC" in told
        assert "last written" in told
        code, told = run("fetch", "drone", "--latest", "--to", "got", "--json")
        (file,) = json.loads(told)
        assert (code, Path(file).read_bytes()) == (0, DATAFLASH)
        assert run("fetch", "drone")[0] == 2
        code, told = run("fetch", "drone", "7")
        assert code != 0
        assert "has no log 7; it has 1, 2" in told
    code, told = run("list", "other")
    assert code != 0
    assert "no logs can be fetched by the driver simulated" in told


@pytest.mark.parametrize(("family", "write"), [("ardupilot", dataflash), ("px4", ulog)])
def test_the_log_of_a_recorded_flight_is_attached(
    flight: Flight,
    tmp_path: Path,
    run: Callable[..., tuple[int, str]],
    family: Literal["ardupilot", "px4"],
    write: Callable[[Flown], bytes],
) -> None:
    """The one that was written then, by itself; another one that is named is refused."""
    ends = flight(AutopilotOptions(family=family))
    settings = {"url": f"udpin:{LOOPBACK}:{ends.port}", "fallback": "ignore", "failsafes": "ignore"}
    drone = {"id": "drone", "driver": "mavlink", "settings": settings}
    (tmp_path / "environment.json").write_text(json.dumps({"robots": [drone]}))
    recording = record_flown(tmp_path / "flight.mcap", Flown(duration=12.0))
    own, other = write(Flown(duration=12.0)), write(Flown(zero=500.0, duration=12.0))
    with ends.unconnected():
        autopilot = ends.autopilot
        store = autopilot.firmware.logs
        store.logs = {1: other, 2: own, 3: other}
        # Of a flight of 12 seconds: they are when a log was last written.
        store.times = {1: EPOCH - 600, 2: EPOCH + 9, 3: EPOCH + 600}
        code, told = run("fetch", "drone", "1", "--attach", "flight.mcap")
        assert code != 0
        assert "is of another flight" in told
        code, told = run("fetch", "drone", "--attach", "flight.mcap", "--to", "got")
        assert code == 0, told
        assert "of drone" in told
        assert "covers 0.0 to 1" in told
        store.times = dict.fromkeys(store.logs, 0)
        code, told = run("fetch", "drone", "--attach", "flight.mcap")
        assert code != 0
        assert "no log that it was written at 2027-01-15 08:00:05 UTC" in told
        code, told = run("fetch", "drone", "--attach", "none.mcap")
        assert "cannot open the recording none.mcap" in told
    with Recording.open(recording) as opened:
        (name,) = opened.attachments
        assert name.startswith("vehicle_logs/drone/log-2-")
        assert opened.attachment(name) == own


def test_the_command_changes_nothing_at_the_vehicle(
    flight: Flight, tmp_path: Path, run: Callable[..., tuple[int, str]]
) -> None:
    """Whatever a flight would set: who looks at logs does not fly."""
    ends = flight(AutopilotOptions(family="ardupilot"))
    settings = {
        "url": f"udpin:{LOOPBACK}:{ends.port}",
        "fallback": "set",
        "failsafes": "set",
        "fence": "land",
    }
    limits = {"geofence": {"polygon": [[-9, -9], [9, -9], [9, 9], [-9, 9]]}}
    drone = {"id": "drone", "driver": "mavlink", "limits": limits, "settings": settings}
    (tmp_path / "environment.json").write_text(json.dumps({"robots": [drone]}))
    with ends.unconnected():
        autopilot = ends.autopilot
        autopilot.firmware.logs.logs = {1: DATAFLASH[:90]}
        code, told = run("list", "drone")
        assert code == 0, told
        kinds = {message.get_type() for _, message in autopilot.heard}
    assert "LOG_REQUEST_LIST" in kinds
    assert not kinds & {"PARAM_SET", "MISSION_COUNT", "MISSION_CLEAR_ALL"}

"""Logs of real autopilots in simulation."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from pymavlink import DFReader
from required import needs_peer, peer
from sitl.autopilot import Autopilot
from sitl.flights import SitlFlight, robot_at, survey
from sitl.relay import Relay

from aerodaas.config.model import EnvironmentConfig
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.extensions.sitl.process import SitlOptions, SitlProcess
from aerodaas.extensions.vehicle_logs.log_service import LogEntry
from aerodaas.extensions.vehicle_logs.mavlink_logs import MavlinkLogs
from aerodaas.messages.mission import MissionState
from aerodaas.testing.channel import Impairment

STEPS = 0.01
"""Seconds by which a simulator's clock, which goes in steps of 2.5 ms, may be beside ours."""

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]


@pytest.fixture
def relayed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[str, Relay]]:
    """An ArduCopter that logs from its start on, in the test's own folder, behind a relay."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "journals"))
    parameters = tmp_path / "logs.parm"
    parameters.write_text("LOG_DISARMED 1\nLOG_FILE_DSRMROT 0\nLOG_BITMASK 2\n")
    source = Path(peer("AERODAAS_ARDUPILOT"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    options = SitlOptions(tmp_path / "state", source, port=port, instance=3, defaults=[parameters])
    with SitlProcess("ardupilot", options) as simulator:
        relay = Relay(simulator.url)
        try:
            yield relay.url, relay
        finally:
            relay.close()


def newest_log(vehicle: MavlinkVehicle) -> LogEntry:
    """The newest log, once it grows no more: a busy simulator writes on after the landing."""
    logs = MavlinkLogs(vehicle)
    log, size = logs.logs()[-1], -1
    until = time.monotonic() + 60.0
    while log.size != size:
        assert time.monotonic() < until, f"log {log.number} goes on growing"
        time.sleep(2.0)
        log, size = logs.logs()[-1], log.size
    return log


def around_a_change(vehicle: MavlinkVehicle) -> tuple[float, float]:
    """Seconds of its clock, by TIMESYNC, between which it changes a parameter."""
    deadline = time.monotonic() + 30.0
    while vehicle.read().extra.get("autopilot_time_error", 1.0) > 0.1:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    before, error = own_time(vehicle)
    vehicle.parameters.set("WP_YAW_BEHAVIOR", 0.0)
    after, _ = own_time(vehicle)
    print(f"\nTIMESYNC within {1e3 * error:.1f} ms")  # noqa: T201
    return before - error - STEPS, after + error + STEPS


def own_time(vehicle: MavlinkVehicle) -> tuple[float, float]:
    """What its clock reads now, and by how much that may be wrong."""
    told = vehicle.telemetry.boot_clock.reading(time.monotonic())
    assert told is not None
    return told


@needs_peer("AERODAAS_ARDUPILOT")
def test_a_log_comes_down_byte_for_byte(relayed: tuple[str, Relay], tmp_path: Path) -> None:
    """Over a link that loses, doubles and shuffles packets.

    Its own times in it are those that TIMESYNC tells.
    """
    url, relay = relayed
    robot = robot_at(url, {"failsafes": "ignore", "fallback": "ignore", "ready_timeout": 60.0})
    vehicle = MavlinkVehicle(robot, EnvironmentConfig(robots=[robot]))
    vehicle.connect(60.0)
    try:
        began, ended = around_a_change(vehicle)
        vehicle.parameters.set("LOG_DISARMED", 0.0)
        log = newest_log(vehicle)
        (original,) = (tmp_path / "state" / "logs").glob("*.BIN")
        bad = Impairment(loss=0.02, duplicates=0.02, jitter=0.01)
        relay.spoil(bad)
        file = MavlinkLogs(vehicle).fetch_log(log, tmp_path)
        assert file.read_bytes() == original.read_bytes()
    finally:
        vehicle.close()
    reader = DFReader.DFReader_binary(str(file))
    changes = []
    while (message := reader.recv_match(type="PARM")) is not None:
        changes += [message.TimeUS / 1e6] if message.Name == "WP_YAW_BEHAVIOR" else []
    assert began <= changes[-1] <= ended
    print(  # noqa: T201
        f"\n{file.name}: {file.stat().st_size} bytes; a change between {began:.4f} "
        f"and {ended:.4f} s of its clock by TIMESYNC is in it at {changes[-1]:.4f} s"
    )


def test_its_own_log_is_fetched(
    autopilot: Autopilot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a flight: the newest one is whole, and its own reader finds the flight in it."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "journals"))
    with SitlFlight(autopilot.url, survey((0, 3))) as flight:
        flight.run(180.0)
        assert flight.mission.state is MissionState.LANDED, flight.story
        log = newest_log(flight.vehicle)
        file = MavlinkLogs(flight.vehicle).fetch_log(log, tmp_path)
        print(f"\n{file.name}: {file.stat().st_size} bytes")  # noqa: T201
        assert file.stat().st_size == log.size
    if autopilot.family == "ardupilot":
        reader = DFReader.DFReader_binary(str(file))
        heights = []
        while (message := reader.recv_match(type="CTUN")) is not None:
            heights.append(message.Alt)
        assert max(heights) > 2.0

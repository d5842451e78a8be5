"""Strangers on the vehicle's port: what they send is dropped, and moves nothing."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest
from handmade import Handmade
from mavlink_flights import LOOPBACK, flight, wait_for
from test_mavlink_link import BEAT, HERE, KEY, LOOK, SPEED, THERE, World

from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire import transport
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.signing import sign_with
from aerodaas.drivers.mavlink.wire.transport import is_exposed
from aerodaas.types.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions


def _armed(key: bytes | None = None, system: int = 1) -> bytes:
    """A forged HEARTBEAT: armed, and in PX4's manual mode."""
    mav = mavlink.MAVLink(None, system, 1)
    if key is not None:
        sign_with(mav, key)
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return bytes(mavlink.MAVLink_heartbeat_message(2, 12, armed, 1 << 16, 4, 3).pack(mav))


def test_a_forged_heartbeat_takes_no_vehicle() -> None:
    """It neither gets the commands nor is believed, and people are told."""
    with flight() as pair, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker:
        attacker.bind((LOOPBACK, 0))
        attacker.settimeout(0.0)
        port = pair.autopilot.options.peer[1]

        def forge() -> bool:
            attacker.sendto(_armed(), (LOOPBACK, port))
            return bool(pair.vehicle.read().extra["impostor_packets"] >= 20)

        wait_for(forge)
        assert pair.vehicle.read().mode is VehicleMode.GROUNDED
        told = [one for one in pair.vehicle.read().faults if "sends as the vehicle" in one]
        assert told == [
            f"link: {LOOPBACK}:{attacker.getsockname()[1]} sends as the vehicle, and is not heard"
        ]
        pair.guide()
        with pytest.raises(BlockingIOError):
            attacker.recv(4096)
        assert pair.heard("SET_POSITION_TARGET_LOCAL_NED")


def test_an_impostor_moves_nothing_while_the_vehicle_speaks(world: World) -> None:
    """Not its telemetry, not an answer that is waited for, and it is told by its address once."""
    world.link.adopt((1, 1), HERE, 100.0)
    with world.link.listen("ATTITUDE") as answers:
        for second in range(20):
            world.says(BEAT)
            world.says(BEAT, peer=THERE)
            world.says(LOOK, peer=THERE)
            world.says(LOOK, peer=("10.0.0.2", 777))
            world.link.turn(101.0 + second)
        assert answers.empty()
    assert {kind for kind, _ in world.heard} == {"HEARTBEAT"}
    assert (world.link.counts.received, world.link.counts.impostors) == (20, 60)
    said = ["link: 10.0.0.2:14550 sends as the vehicle, and is not heard"]
    assert world.link.reports(130.0) == said
    assert world.link.reports(130.1) == []


@pytest.mark.parametrize(
    ("silent", "stands", "message", "moves"),
    [
        (5.1, True, BEAT, True),
        (4.9, True, BEAT, False),
        (5.1, True, LOOK, False),
        (60.0, False, BEAT, False),
    ],
)
def test_a_vehicle_that_starts_anew_elsewhere(
    world: World,
    silent: float,
    message: Any,  # noqa: ANN401
    *,
    stands: bool,
    moves: bool,
) -> None:
    """Is adopted by its HEARTBEAT after 5 s of silence on the ground, and never in flight."""
    world.stands = stands
    world.link.adopt((1, 1), HERE, 90.0)
    world.says(LOOK)
    world.link.turn(100.0)
    world.says(message, peer=THERE)
    world.link.turn(100.0 + silent)
    world.link.send(BEAT)
    assert world.wire.sent[-1][1] == ((THERE,) if moves else (HERE,))
    assert world.link.counts.impostors == (not moves)
    told = world.link.reports(100.0 + silent)
    assert ("link: the vehicle is heard from 10.0.0.2:14550 now" in told) is moves


def test_a_jammed_vehicle_is_not_taken_in_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither in the air nor while it is about to leave the ground; it is, once it stands."""
    world = Handmade(monkeypatch)
    world.connect()
    assert world.vehicle._stands()
    world.fly()
    assert not world.vehicle._stands()
    world.speaks, world.result = False, None
    attacker = ("127.0.0.1", 6666)
    for _ in range(200):
        world._inbox.append((_armed(), attacker))
        world.turn()
    state = world.vehicle.read()
    assert state.mode is VehicleMode.LOST
    assert state.extra["impostor_packets"] == 200
    assert "link: 127.0.0.1:6666 sends as the vehicle, and is not heard" in state.faults
    world.speaks = True
    assert world.turn(1.5) is VehicleMode.HOLDING, "the true one is heard as before"


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """An open link."""
    return World(monkeypatch)


@pytest.fixture
def keyed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> World:
    """An open link that signs."""
    path = tmp_path / "key"
    path.write_bytes(KEY)
    return World(monkeypatch, signing_key=str(path))


def test_a_signed_vehicle_is_followed_even_in_flight(keyed: World) -> None:
    """After the same silence; its key tells that it is the same."""
    keyed.stands = False
    keyed.link.adopt((1, 1), HERE, 100.0)
    keyed.says(BEAT, key=KEY, peer=THERE)
    keyed.link.turn(104.0)
    assert keyed.link.counts.impostors == 1
    keyed.says(BEAT, key=KEY, peer=THERE)
    keyed.link.turn(106.0)
    keyed.link.send(BEAT)
    assert keyed.wire.sent[-1][1] == (THERE,)


def test_unsigned_wrongly_signed_and_replayed_packets_are_told(keyed: World) -> None:
    """Each is dropped; what is merely damaged is no forgery."""
    keyed.link.adopt((1, 1), HERE, 100.0)
    packet = keyed.says(LOOK, key=KEY)
    keyed.link.turn(100.0)
    assert (keyed.link.counts.received, keyed.link.reports(100.0)) == (1, [])
    damaged = bytearray(packet)
    damaged[12] ^= 1
    keyed.wire.inbox.append((bytes(damaged), HERE))
    keyed.link.turn(110.0)
    assert (keyed.link.counts.refused, keyed.link.reports(110.0)) == (0, [])
    for count, forged in enumerate((packet, _armed(), _armed(bytes(32))), 1):
        keyed.wire.inbox.append((forged, HERE))
        keyed.link.turn(120.0)
        assert keyed.link.counts.refused == count
    assert keyed.link.counts.received == 1
    said = "link: packets that are unsigned, wrongly signed or replayed are dropped"
    assert keyed.link.reports(130.0) == [said]
    assert keyed.link.reports(131.0) == []


def test_a_forged_time_does_not_lock_the_vehicle_out(keyed: World) -> None:
    """A wrongly signed packet from the future leaves the true one's timestamps alone."""
    forger = mavlink.MAVLink(None, 1, 1)
    sign_with(forger, bytes(32))
    forger.signing.timestamp += 10**9
    keyed.wire.inbox.append((bytes(BEAT.pack(forger)), HERE))
    keyed.link.turn(100.0)
    keyed.says(LOOK, key=KEY)
    keyed.link.turn(100.1)
    assert [kind for kind, _ in keyed.heard] == ["ATTITUDE"]


def test_the_ground_station_gets_nothing_forged(monkeypatch: pytest.MonkeyPatch) -> None:
    """What uses the vehicle's ids from elsewhere stays here, and so does what cannot be read."""
    world = World(monkeypatch, forward="udpout:127.0.0.1:14550")
    world.link.adopt((1, 1), HERE, 100.0)
    passed = [world.says(BEAT), world.says(BEAT, 2, peer=THERE), world.says(SPEED)]
    world.says(BEAT, peer=THERE)
    world.says(SPEED, peer=THERE)
    world.says(BEAT, 2, peer=("10.0.0.3", 1))
    world.wire.inbox.append((b"noise" + passed[0], ("10.0.0.3", 1)))
    world.wire.inbox.append((passed[1] + passed[0], THERE))
    world.link.turn(100.1)
    assert [packet for packet, _ in world.station.sent] == passed


def test_a_second_ground_station_commands_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first to send to the forwarding port keeps it until it is silent and the drone stands."""
    world = World(monkeypatch, forward="udpin:127.0.0.1:14550")
    world.healthy = False
    world.link.adopt((1, 1), HERE, 100.0)
    station, attacker = ("127.0.0.1", 1), ("127.0.0.1", 2)
    world.station.inbox = [(b"first", station), (b"attack", attacker)]
    world.link.turn(101.0)
    world.stands = False
    world.station.inbox = [(b"attack", attacker)]
    world.link.turn(200.0)
    world.says(BEAT)
    world.link.turn(200.1)
    assert [packet for packet, _ in world.wire.sent] == [b"first"]
    assert [peers for _, peers in world.station.sent] == [(station,)]
    assert world.link.counts.strangers == 2
    said = "link: 127.0.0.1:2 sends as the ground station, and is not heard"
    assert world.link.reports(200.1) == [said]
    world.stands = True
    world.station.inbox = [(b"next", attacker)]
    world.link.turn(201.0)
    assert world.wire.sent[-1][0] == b"next"


@pytest.mark.parametrize(
    ("url", "exposed"),
    [
        ("udpin:127.0.0.1:14540", False),
        ("udpout:localhost:14540", False),
        ("tcp:127.0.0.2:5760", False),
        ("serial:/dev/ttyUSB0:57600", False),
        ("udpin:0.0.0.0:14540", True),
        ("udpout:192.0.2.1:14540", True),
        ("tcp:203.0.113.9:5760", True),
    ],
)
def test_what_others_can_send_to_is_warned_of(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    url: str,
    *,
    exposed: bool,
) -> None:
    """Off loopback, unless all is signed; the forwarding port, too."""
    assert is_exposed(url) is exposed
    key = tmp_path / "key"
    key.write_bytes(KEY)
    World(monkeypatch, url=url, forward=url, signing_key=str(key))
    assert caplog.messages == []
    World(monkeypatch, forward=url)
    assert len(caplog.messages) == exposed
    World(monkeypatch, url=url)
    assert len(caplog.messages) == 2 * exposed
    assert all(url in one and "signing_key" in one for one in caplog.messages)


def test_it_listens_on_loopback_unless_told_otherwise() -> None:
    """Of the settings and of the command that checks a vehicle."""
    assert MavlinkSettings().url == "udpin:127.0.0.1:14540"


def test_a_server_is_found_again_at_its_own_address(monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that leads to another host after the TCP connection was cut is not followed."""
    monkeypatch.setattr(transport, "_RETRY", 0.05)
    places = [LOOPBACK, "127.0.0.9"]
    resolve = socket.getaddrinfo

    def resolved(host: str, port: int, *more: Any, **rest: Any) -> Any:  # noqa: ANN401
        return resolve(places[0] if host == "vehicle.test" else host, port, *more, **rest)

    monkeypatch.setattr(socket, "getaddrinfo", resolved)
    with socket.create_server((LOOPBACK, 0)) as true:
        port = true.getsockname()[1]
        with socket.create_server(("127.0.0.9", port)) as false:
            true.settimeout(5.0)
            false.settimeout(0.0)
            wire = transport.open_transport(f"tcp:vehicle.test:{port}", "d")
            true.accept()[0].close()
            del places[0]
            again: list[socket.socket] = []

            def back() -> bool:
                wire.receive()
                true.settimeout(0.01)
                try:
                    again.append(true.accept()[0])
                except TimeoutError:
                    return False
                return True

            wait_for(back, 5.0)
            with pytest.raises(BlockingIOError):
                false.accept()
            wire.close()
            again[0].close()


def test_a_signed_flight_over_a_wire_with_strangers(tmp_path: Path) -> None:
    """With one key at both ends it flies, whatever else is sent to its port."""
    key = tmp_path / "key"
    key.write_bytes(KEY)
    with (
        flight(AutopilotOptions(key=KEY), signing_key=str(key)) as pair,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker,
    ):
        port = pair.autopilot.options.peer[1]
        for _ in range(50):
            attacker.sendto(_armed(), (LOOPBACK, port))
            attacker.sendto(_armed(bytes(32)), (LOOPBACK, port))
        pair.take_off()
        assert pair.vehicle.read().extra["refused_packets"] >= 100

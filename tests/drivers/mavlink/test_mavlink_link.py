"""The link to an autopilot: whom it hears and answers; what strangers send moves nothing."""

from __future__ import annotations

import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from autopilot import HERE, THERE, Wire
from bench import Bench
from emulated import LOOPBACK, Flight
from waiting import until

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire import forwarding, transport
from aerodaas.drivers.mavlink.wire import link as module
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.drivers.mavlink.wire.signing import sign_with
from aerodaas.drivers.mavlink.wire.transport import is_exposed
from aerodaas.drivers.pin import Peer
from aerodaas.messages.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions

KEY = bytes(range(32))


class World:
    """A link, its wire, and other systems on it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> None:  # noqa: ANN401
        monkeypatch.delenv(MAVLINK_KEY, raising=False)
        monkeypatch.setattr(MavlinkLink, "_start", lambda _: None)
        self.wire, self.station = Wire(), Wire()
        self.opened: list[tuple[str, str]] = []

        def opening(wire: Wire) -> Callable[[str, str], Wire]:
            def opened(url: str, name: str) -> Wire:
                self.opened.append((url, name))
                return wire

            return opened

        monkeypatch.setattr(module, "open_transport", opening(self.wire))
        monkeypatch.setattr(forwarding, "open_transport", opening(self.station))
        self.heard: list[tuple[str, float]] = []
        self.turns: list[float] = []
        self.healthy = self.stands = True
        self.link = MavlinkLink(
            "d",
            MavlinkSettings(**settings),
            on_message=lambda message, now, _: self.heard.append((message.get_type(), now)),
            on_turn=self.turns.append,
            healthy=lambda _: self.healthy,
            stands=lambda: self.stands,
            messages=("HEARTBEAT", "ATTITUDE"),
        )
        self.link.open()
        self._others: dict[tuple[int, int], Any] = {}

    def says(
        self,
        message: Any,  # noqa: ANN401 - pymavlink has no types
        system: int = 1,
        component: int = 1,
        peer: Peer = HERE,
        key: bytes | None = None,
    ) -> bytes:
        """Somebody says something, at the next turn."""
        other = self._others.get((system, component))
        if other is None:
            other = self._others[system, component] = mavlink.MAVLink(None, system, component)
            if key is not None:
                sign_with(other, key)
        packet = bytes(message.pack(other))
        self.wire.inbox.append((packet, peer))
        return packet

    def sent(self) -> list[Any]:
        """What we said, read."""
        return [mavlink.MAVLink(None, 9, 9).decode(bytearray(one)) for one, _ in self.wire.sent]


BEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
LOOK = mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)
SPEED = mavlink.MAVLink_vfr_hud_message(1, 2, 3, 4, 5, 6)


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> World:
    """An open link."""
    return World(monkeypatch)


def test_its_heartbeats_go_out_once_a_second_while_the_loop_is_well(world: World) -> None:
    """From the first turn on; one that was held back goes out as soon as all is well."""
    seen = {}
    for tenth in range(25):
        world.healthy = not 9 <= tenth <= 14
        world.link.step(100.0 + tenth / 10)
        seen[tenth] = world.link.counts.sent
    assert seen == {tenth: 1 + (tenth >= 15) for tenth in range(25)}
    world.link.step(102.51)
    assert [one.get_type() for one in world.sent()] == ["HEARTBEAT"] * 3


@pytest.mark.parametrize(
    ("role", "system", "kind"),
    [
        ("companion", 245, mavlink.MAV_TYPE_ONBOARD_CONTROLLER),
        ("ground_station", 255, mavlink.MAV_TYPE_GCS),
    ],
)
def test_what_its_heartbeats_say(
    monkeypatch: pytest.MonkeyPatch, role: str, system: int, kind: int
) -> None:
    """That it is no autopilot, and alive; under its own numbers."""
    world = World(monkeypatch, role=role, own_component=77)
    world.link.step(100.0)
    (beat,) = world.sent()
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (system, 77)
    assert (beat.type, beat.autopilot) == (kind, mavlink.MAV_AUTOPILOT_INVALID)
    assert (beat.base_mode, beat.custom_mode) == (0, 0)
    assert (beat.system_status, beat.mavlink_version) == (mavlink.MAV_STATE_ACTIVE, 3)


def test_before_it_knows_its_vehicle_it_hears_everybody(world: World) -> None:
    """And only the one system's one component from then on."""
    world.says(BEAT, 1)
    world.says(BEAT, 2, 5)
    world.link.step(100.0)
    assert world.heard == [("HEARTBEAT", 100.0)] * 2
    with pytest.raises(AssertionError):
        _ = world.link.target
    world.link.adopt((2, 5), HERE, 100.0)
    for system, component in ((1, 1), (2, 1), (1, 5), (2, 5)):
        world.says(LOOK, system, component)
    world.link.step(101.0)
    assert world.heard[2:] == [("ATTITUDE", 101.0)]
    assert (world.link.counts.received, world.link.counts.strangers) == (3, 3)


def test_it_answers_to_the_address_of_its_vehicle(world: World) -> None:
    """To everybody's, each once, before it is known; to its own alone after that."""
    world.link.send(BEAT)
    world.says(BEAT, 1, peer=HERE)
    world.says(BEAT, 2, peer=THERE)
    world.says(BEAT, 3, peer=THERE)
    world.link.step(100.0)
    world.link.send(BEAT)
    world.link.adopt((2, 1), THERE, 100.0)
    world.link.send(BEAT)
    world.says(BEAT, 2, peer=HERE)
    world.link.step(100.1)
    world.link.send(BEAT)
    peers = [peers for _, peers in world.wire.sent]
    assert peers == [(), (HERE, THERE), (HERE, THERE), (THERE,), (THERE,)]


def test_who_waits_for_an_answer_gets_it(world: World) -> None:
    """By its name, of the vehicle only, for as long as it waits; several may."""
    world.link.adopt((1, 1), HERE, 100.0)
    with (
        world.link.listen("ATTITUDE", "SYSTEM_TIME") as both,
        world.link.listen("HEARTBEAT") as one,
    ):
        world.says(LOOK)
        world.says(BEAT)
        world.says(LOOK, 2)
        world.link.step(100.0)
        assert [both.get_nowait().get_type(), one.get_nowait().get_type()] == [
            "ATTITUDE",
            "HEARTBEAT",
        ]
        assert both.empty()
        assert one.empty()
    world.says(LOOK)
    world.link.step(101.0)
    assert both.empty()


def test_a_listener_gets_messages_that_the_driver_does_not_process(world: World) -> None:
    """A service that nobody else needs is one of its own."""
    entry = mavlink.MAVLink_log_entry_message(1, 1, 1, 0, 90)
    with world.link.listen("LOG_ENTRY") as entries:
        world.says(entry)
        world.link.step(100.0)
        assert entries.get_nowait().size == 90


def test_what_a_wire_brings_in_pieces_is_put_together(world: World) -> None:
    """On one without addresses; a datagram's beginning is no other one's."""
    packet = world.says(LOOK, peer=None)
    world.wire.inbox = [(packet[:9], None), (packet[9:], None)]
    world.link.step(100.0)
    assert [kind for kind, _ in world.heard] == ["ATTITUDE"]
    world.wire.inbox = [(packet[:9], HERE), (packet[9:], HERE)]
    world.link.step(101.0)
    assert len(world.heard) == 1
    world.says(LOOK)
    world.link.step(102.0)
    assert len(world.heard) == 2


def test_senders_are_put_together_apart(world: World) -> None:
    """The halves of two wires' packets do not mix, and what makes no sense is counted."""
    packet = world.says(LOOK, peer=None)
    world.wire.inbox = [(packet[:9], None), (b"\xfd", HERE), (packet[9:], None)]
    world.link.step(100.0)
    assert len(world.heard) == 1
    assert world.link.counts.damaged == 0
    spoilt = bytearray(packet)
    spoilt[12] ^= 1
    world.wire.inbox = [(bytes(spoilt), HERE), (bytes(spoilt), THERE)]
    world.link.step(101.0)
    assert world.link.counts.damaged >= 2
    assert len(world.heard) == 1


def test_a_crowd_on_one_port_is_forgotten(world: World) -> None:
    """64 senders' addresses are remembered, and all go on to be heard."""
    for system in range(1, 81):
        world.says(BEAT, system, peer=(f"10.0.0.{system}", 1))
        world.link.step(100.0 + system)
    world.wire.sent.clear()
    world.link.send(BEAT)
    ((_, peers),) = world.wire.sent
    assert peers == tuple((f"10.0.0.{system}", 1) for system in range(1, 65))
    assert len(world.heard) == 80


def test_everything_is_passed_on_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """Byte by byte, whoever says it and whatever it is; back to all that were heard."""
    world = World(monkeypatch, forward="udpout:127.0.0.1:14550")
    assert world.opened == [
        (MavlinkSettings().url, "d"),
        ("udpout:127.0.0.1:14550", "d, forward"),
    ]
    said = [world.says(BEAT, 1), world.says(SPEED, 2, peer=THERE)]
    world.wire.inbox.append((b"noise", THERE))
    world.says(BEAT, 3, peer=THERE)
    world.healthy = False
    world.link.step(100.0)
    assert [packet for packet, _ in world.station.sent][:3] == [*said, b"noise"]
    world.station.inbox = [(b"one", None), (b"two", None)]
    world.link.step(100.1)
    assert world.wire.sent == [(b"one", (HERE, THERE)), (b"two", (HERE, THERE))]
    world.link.close()
    assert world.wire.closed
    assert world.station.closed


def forged(key: bytes | None = None, system: int = 1) -> bytes:
    """A forged HEARTBEAT: armed, and in PX4's manual mode."""
    mav = mavlink.MAVLink(None, system, 1)
    if key is not None:
        sign_with(mav, key)
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    return bytes(mavlink.MAVLink_heartbeat_message(2, 12, armed, 1 << 16, 4, 3).pack(mav))


@pytest.fixture
def keyed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> World:
    """An open link that signs."""
    path = tmp_path / "key"
    path.write_bytes(KEY)
    return World(monkeypatch, signing_key=str(path))


def test_an_impostor_moves_nothing_while_the_vehicle_speaks(world: World) -> None:
    """Not its telemetry, not an answer that is waited for, and it is told by its address once."""
    world.link.adopt((1, 1), HERE, 100.0)
    with world.link.listen("ATTITUDE") as answers:
        for second in range(20):
            world.says(BEAT)
            world.says(BEAT, peer=THERE)
            world.says(LOOK, peer=THERE)
            world.says(LOOK, peer=("10.0.0.2", 777))
            world.link.step(101.0 + second)
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
    world.link.step(100.0)
    world.says(message, peer=THERE)
    world.link.step(100.0 + silent)
    world.link.send(BEAT)
    assert world.wire.sent[-1][1] == ((THERE,) if moves else (HERE,))
    assert world.link.counts.impostors == (not moves)
    told = world.link.reports(100.0 + silent)
    assert ("link: the vehicle is heard from 10.0.0.2:14550 now" in told) is moves


def test_a_signed_vehicle_is_followed_even_in_flight(keyed: World) -> None:
    """After the same silence; its key tells that it is the same."""
    keyed.stands = False
    keyed.link.adopt((1, 1), HERE, 100.0)
    keyed.says(BEAT, key=KEY, peer=THERE)
    keyed.link.step(104.0)
    assert keyed.link.counts.impostors == 1
    keyed.says(BEAT, key=KEY, peer=THERE)
    keyed.link.step(106.0)
    keyed.link.send(BEAT)
    assert keyed.wire.sent[-1][1] == (THERE,)


def test_unsigned_wrongly_signed_and_replayed_packets_are_told(keyed: World) -> None:
    """Each is dropped; what is merely damaged is no forgery."""
    keyed.link.adopt((1, 1), HERE, 100.0)
    packet = keyed.says(LOOK, key=KEY)
    keyed.link.step(100.0)
    assert (keyed.link.counts.received, keyed.link.reports(100.0)) == (1, [])
    damaged = bytearray(packet)
    damaged[12] ^= 1
    keyed.wire.inbox.append((bytes(damaged), HERE))
    keyed.link.step(110.0)
    assert (keyed.link.counts.refused, keyed.link.reports(110.0)) == (0, [])
    for count, sent in enumerate((packet, forged(), forged(bytes(32))), 1):
        keyed.wire.inbox.append((sent, HERE))
        keyed.link.step(120.0)
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
    keyed.link.step(100.0)
    keyed.says(LOOK, key=KEY)
    keyed.link.step(100.1)
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
    world.link.step(100.1)
    assert [packet for packet, _ in world.station.sent] == passed


def test_a_second_ground_station_commands_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first to send to the forwarding port keeps it until it is silent and the drone stands."""
    world = World(monkeypatch, forward="udpin:127.0.0.1:14550")
    world.healthy = False
    world.link.adopt((1, 1), HERE, 100.0)
    station, attacker = ("127.0.0.1", 1), ("127.0.0.1", 2)
    world.station.inbox = [(b"first", station), (b"attack", attacker)]
    world.link.step(101.0)
    world.stands = False
    world.station.inbox = [(b"attack", attacker)]
    world.link.step(200.0)
    world.says(BEAT)
    world.link.step(200.1)
    assert [packet for packet, _ in world.wire.sent] == [b"first"]
    assert [peers for _, peers in world.station.sent] == [(station,)]
    assert world.link.counts.strangers == 2
    said = "link: 127.0.0.1:2 sends as the ground station, and is not heard"
    assert world.link.reports(200.1) == [said]
    world.stands = True
    world.station.inbox = [(b"next", attacker)]
    world.link.step(201.0)
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

            until(back, 5.0)
            with pytest.raises(BlockingIOError):
                false.accept()
            wire.close()
            again[0].close()


def test_a_jammed_vehicle_is_not_taken_in_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither its word nor its place is another's; the true one is heard as before."""
    bench = Bench(monkeypatch)
    bench.connect()
    bench.fly()
    bench.hush()
    for _ in range(200):
        bench.autopilot.wire.inbox.append((forged(), THERE))
        bench.turn()
    state = bench.vehicle.read()
    assert state.mode is VehicleMode.LOST
    assert state.extra["impostor_packets"] == 200
    assert "link: 10.0.0.2:14550 sends as the vehicle, and is not heard" in state.faults
    bench.hush(off=True)
    assert bench.turn(1.5) is VehicleMode.HOLDING
    bench.close()


def test_a_signed_flight_over_a_wire_with_strangers(flight: Flight, tmp_path: Path) -> None:
    """With one key at both ends it flies, whatever else is sent to its port."""
    key = tmp_path / "key"
    key.write_bytes(KEY)
    with (
        flight(AutopilotOptions(key=KEY), signing_key=str(key)) as ends,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as attacker,
    ):
        for _ in range(50):
            attacker.sendto(forged(), (LOOPBACK, ends.port))
            attacker.sendto(forged(bytes(32)), (LOOPBACK, ends.port))
        ends.take_off()
        assert ends.vehicle.read().extra["refused_packets"] >= 100

"""The link to an autopilot on a clock that the test moves: whom it hears, and whom it answers."""

from __future__ import annotations

import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire import forwarding
from aerodaas.drivers.mavlink.wire import link as module
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.drivers.mavlink.wire.signing import sign_with
from aerodaas.drivers.pin import Peer

KEY = bytes(range(32))
HERE, THERE = ("10.0.0.1", 14550), ("10.0.0.2", 14550)


class _Wire:
    """One end of a wire, or a ground station to which all is passed on."""

    def __init__(self) -> None:
        self.inbox: list[Any] = []
        self.sent: list[tuple[bytes, tuple[Peer, ...]]] = []
        self.closed = False

    def receive(self) -> list[Any]:
        """What has arrived."""
        arrived, self.inbox = self.inbox, []
        return arrived

    def send(self, packet: bytes, peers: tuple[Peer, ...] = ()) -> None:
        """Send it."""
        assert not self.closed
        self.sent.append((packet, peers))

    def close(self) -> None:
        """Cut it."""
        self.closed = True

    @staticmethod
    def fileno() -> int:
        """It is never waited for."""
        return -1


class World:
    """A link, its wire, and other systems on it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> None:  # noqa: ANN401
        monkeypatch.delenv(MAVLINK_KEY, raising=False)
        monkeypatch.setattr(MavlinkLink, "_start", lambda _: None)
        self.wire, self.station = _Wire(), _Wire()
        self.opened: list[tuple[str, str]] = []

        def opening(wire: _Wire) -> Callable[[str, str], _Wire]:
            def opened(url: str, name: str) -> _Wire:
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
        world.link.turn(100.0 + tenth / 10)
        seen[tenth] = world.link.counts.sent
    assert seen == {tenth: 1 + (tenth >= 15) for tenth in range(25)}
    world.link.turn(102.51)
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
    world.link.turn(100.0)
    (beat,) = world.sent()
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (system, 77)
    assert (beat.type, beat.autopilot) == (kind, mavlink.MAV_AUTOPILOT_INVALID)
    assert (beat.base_mode, beat.custom_mode) == (0, 0)
    assert (beat.system_status, beat.mavlink_version) == (mavlink.MAV_STATE_ACTIVE, 3)


def test_the_driver_gets_a_turn_each_twentieth_of_a_second(world: World) -> None:
    """However often the thread comes round."""
    for hundredth in range(21):
        world.link.turn(100.0 + hundredth / 100)
    assert world.turns == pytest.approx([100.0, 100.05, 100.1, 100.15, 100.2], abs=0.011)


def test_before_it_knows_its_vehicle_it_hears_everybody(world: World) -> None:
    """And only the one system's one component from then on."""
    world.says(BEAT, 1)
    world.says(BEAT, 2, 5)
    world.link.turn(100.0)
    assert world.heard == [("HEARTBEAT", 100.0)] * 2
    with pytest.raises(AssertionError):
        _ = world.link.target
    world.link.adopt((2, 5), HERE, 100.0)
    for system, component in ((1, 1), (2, 1), (1, 5), (2, 5)):
        world.says(LOOK, system, component)
    world.link.turn(101.0)
    assert world.heard[2:] == [("ATTITUDE", 101.0)]
    assert (world.link.counts.received, world.link.counts.strangers) == (3, 3)


def test_it_answers_to_the_address_of_its_vehicle(world: World) -> None:
    """To everybody's, each once, before it is known; to its own alone after that."""
    world.link.send(BEAT)
    world.says(BEAT, 1, peer=HERE)
    world.says(BEAT, 2, peer=THERE)
    world.says(BEAT, 3, peer=THERE)
    world.link.turn(100.0)
    world.link.send(BEAT)
    world.link.adopt((2, 1), THERE, 100.0)
    world.link.send(BEAT)
    world.says(BEAT, 2, peer=HERE)
    world.link.turn(100.1)
    world.link.send(BEAT)
    peers = [peers for _, peers in world.wire.sent]
    assert peers == [(), (HERE, THERE), (HERE, THERE), (THERE,), (THERE,)]


def test_what_is_sent_is_numbered(world: World) -> None:
    """A byte that begins anew after 255."""
    for _ in range(258):
        world.link.send(BEAT)
    assert [one.get_seq() for one in world.sent()] == [*range(256), 0, 1]
    assert world.link.counts.sent == 258


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
        world.link.turn(100.0)
        assert [both.get_nowait().get_type(), one.get_nowait().get_type()] == [
            "ATTITUDE",
            "HEARTBEAT",
        ]
        assert both.empty()
        assert one.empty()
    world.says(LOOK)
    world.link.turn(101.0)
    assert both.empty()


def test_what_a_wire_brings_in_pieces_is_put_together(world: World) -> None:
    """On one without addresses; a datagram's beginning is no other one's."""
    packet = world.says(LOOK, peer=None)
    world.wire.inbox = [(packet[:9], None), (packet[9:], None)]
    world.link.turn(100.0)
    assert [kind for kind, _ in world.heard] == ["ATTITUDE"]
    world.wire.inbox = [(packet[:9], HERE), (packet[9:], HERE)]
    world.link.turn(101.0)
    assert len(world.heard) == 1
    world.says(LOOK)
    world.link.turn(102.0)
    assert len(world.heard) == 2


def test_senders_are_put_together_apart(world: World) -> None:
    """The halves of two wires' packets do not mix, and what makes no sense is counted."""
    packet = world.says(LOOK, peer=None)
    world.wire.inbox = [(packet[:9], None), (b"\xfd", HERE), (packet[9:], None)]
    world.link.turn(100.0)
    assert len(world.heard) == 1
    assert world.link.counts.damaged == 0
    spoilt = bytearray(packet)
    spoilt[12] ^= 1
    world.wire.inbox = [(bytes(spoilt), HERE), (bytes(spoilt), THERE)]
    world.link.turn(101.0)
    assert world.link.counts.damaged >= 2
    assert len(world.heard) == 1


def test_messages_that_nobody_reads_are_passed_over(world: World) -> None:
    """They are not even strangers."""
    world.says(SPEED)
    world.link.turn(100.0)
    counts = world.link.counts
    assert (counts.received, counts.strangers, counts.damaged, world.heard) == (0, 0, 0, [])


def test_a_crowd_on_one_port_is_forgotten(world: World) -> None:
    """64 senders' addresses are remembered, and all go on to be heard."""
    for system in range(1, 81):
        world.says(BEAT, system, peer=(f"10.0.0.{system}", 1))
        world.link.turn(100.0 + system)
    world.wire.sent.clear()
    world.link.send(BEAT)
    ((_, peers),) = world.wire.sent
    assert peers == tuple((f"10.0.0.{system}", 1) for system in range(1, 65))
    assert len(world.heard) == 80
    assert len(world.link._framers) <= 17


def test_with_a_key_it_signs_and_hears_the_signed_alone(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Any,  # noqa: ANN401
) -> None:
    """What was signed by another key, or not at all, is damaged."""
    path = tmp_path / "key"
    path.write_bytes(KEY)
    world = World(monkeypatch, signing_key=str(path))
    world.says(LOOK, 1, key=KEY)
    world.link.turn(100.0)
    assert [kind for kind, _ in world.heard] == ["ATTITUDE"]
    world.says(LOOK, 2, key=bytes(32))
    world.says(LOOK, 3)
    world.link.turn(101.0)
    assert len(world.heard) == 1
    assert world.link.counts.damaged >= 2
    ear = mavlink.MAVLink(None, 9, 9)
    sign_with(ear, KEY)
    packet, _ = world.wire.sent[0]
    assert ear.decode(bytearray(packet)).get_type() == "HEARTBEAT"
    assert packet[2] & 1, "it says that it is signed"


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
    world.link.turn(100.0)
    assert [packet for packet, _ in world.station.sent][:3] == [*said, b"noise"]
    world.station.inbox = [(b"one", None), (b"two", None)]
    world.link.turn(100.1)
    assert world.wire.sent == [(b"one", (HERE, THERE)), (b"two", (HERE, THERE))]
    world.link.close()
    assert world.wire.closed
    assert world.station.closed


def test_without_a_station_nothing_is_passed_on(world: World) -> None:
    """And closing lets the wire go."""
    assert world.opened == [(MavlinkSettings().url, "d")]
    world.says(BEAT)
    world.link.turn(100.0)
    assert world.station.sent == []
    world.link.close()
    assert world.wire.closed
    assert not world.station.closed


class _Over(Exception):  # noqa: N818 - no error
    """The time that the test has given is over."""


class Thread:
    """The link's thread, run by the test: what it waits for, how long, and what it finds then."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, start: Callable[[Any], None]) -> None:
        self.now, self.end = 100.0, 101.0
        self.waits: list[tuple[list[int], float]] = []
        self.how: dict[str, object] = {}
        self.joined: list[float] = []
        self.broken = False
        self.run: Callable[[], None] = lambda: None
        quiet = SimpleNamespace(Thread=self._made, Lock=threading.Lock, Event=threading.Event)
        monkeypatch.setattr(module, "threading", quiet)
        monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: self.now))
        monkeypatch.setattr(module, "select", SimpleNamespace(select=self._select))
        monkeypatch.setattr(MavlinkLink, "_start", start)

    def _made(self, target: Callable[[], None], **how: object) -> Any:  # noqa: ANN401
        self.run, self.how = target, how
        return SimpleNamespace(start=lambda: None, join=self._join)

    def _join(self, timeout: float) -> None:
        self.joined.append(timeout)

    def _select(self, wires: list[int], out: list[int], odd: list[int], longest: float) -> None:
        assert out == odd == []
        self.waits.append((wires, longest))
        if self.now >= self.end:
            raise _Over
        self.now += max(longest, 0.001)
        if self.broken:
            raise OSError


START = MavlinkLink._start


@pytest.mark.parametrize("broken", [False, True])
def test_its_thread_waits_for_the_wire_and_the_next_turn(
    monkeypatch: pytest.MonkeyPatch, *, broken: bool
) -> None:
    """20 turns a second, whatever comes; a wire that is cut is not waited for."""
    world = World(monkeypatch, forward="udpout:127.0.0.1:14550")
    thread = Thread(monkeypatch, START)
    thread.broken = broken
    monkeypatch.setattr(world.station, "fileno", lambda: 77)
    world.link._start()
    assert thread.how == {"name": "d-link", "daemon": True}
    with pytest.raises(_Over):
        thread.run()
    assert 19 <= len(world.turns) <= 21
    assert all(0.0 <= longest <= 0.05 for _, longest in thread.waits)
    wires = thread.waits[0][0]
    assert len(wires) == 2
    assert wires[-1] == 77
    assert -1 not in wires
    monkeypatch.setattr(world.wire, "fileno", lambda: 66)
    thread.end = 102.0
    with pytest.raises(_Over):
        thread.run()
    assert thread.waits[-1][0] == [66, *wires]
    world.link.close()
    assert thread.joined == [2.0]
    turns = len(world.turns)
    thread.end = 200.0
    thread.run()
    assert len(world.turns) == turns, "it has ended"


def test_packets_without_a_name_are_nothing(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """A message of a dialect that is not ours is damaged, not the vehicle's."""
    unknown = SimpleNamespace(get_type=lambda: "UNKNOWN_30")
    monkeypatch.setattr(world.link._mav, "decode", lambda _: unknown)
    world.says(LOOK)
    world.link.turn(100.0)
    assert world.heard == []
    assert world.link.counts.damaged > 0

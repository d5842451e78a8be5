"""Link to one vehicle: one thread that owns its wire, receives, and sends our heartbeats."""

from __future__ import annotations

import contextlib
import logging
import math
import queue
import socket
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Protocol, TypeAlias

from aerodaas.config.extensions import service
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import EventMessage, decoded, mavlink
from aerodaas.drivers.mavlink.wire.forwarding import Forwarder
from aerodaas.drivers.mavlink.wire.framing import Framer
from aerodaas.drivers.mavlink.wire.senders import Sender, SenderPins
from aerodaas.drivers.mavlink.wire.sharing import WireMember, WireShare, share_wire
from aerodaas.drivers.mavlink.wire.signing import SignedCodec, load_key, sign_with
from aerodaas.drivers.mavlink.wire.transport import Transport, is_exposed, open_transport
from aerodaas.drivers.pin import Peer
from aerodaas.drivers.waiting import wait_readable

__all__ = ["LinkCounts", "MavlinkLink", "Message"]

Message: TypeAlias = Any
"""One of pymavlink's, which has no types."""

_log = logging.getLogger(__name__)

_TICK = 0.05
"""Longest time between two turns of the thread, seconds."""
_HEARTBEAT = 1.0
_FRAMERS = 16
"""Addresses from which packets are put together at the same time."""
_TOLD = 10.0
"""Seconds for which refused packets are reported."""

_MESSAGE_IDS = {message.msgname: number for number, message in mavlink.mavlink_map.items()} | {
    EventMessage.msgname: EventMessage.id
}


@dataclass(slots=True)
class LinkCounts:
    """Counters of the wire."""

    received: int = 0
    """Packets of the vehicle that were decoded."""
    damaged: int = 0
    """Invalid bytes and packets, and those with an invalid signature."""
    strangers: int = 0
    """Packets of other systems and components, and to the forwarding port of other programs."""
    impostors: int = 0
    """Packets with the vehicle's ids from another address than its own."""
    refused: int = 0
    """Packets that were unsigned, wrongly signed or replayed, while a key is set."""
    sent: int = 0


class CorrectionsSource(Protocol):
    """Source of corrections for RTK, which reads them in a thread of its own."""

    def reports(self, now: float) -> list[str]:
        """Reports for the operator, one sentence each; `now` is the monotonic clock, seconds."""
        ...

    def close(self) -> None:
        """End the thread and close the source."""


class MavlinkLink:
    """Link to one vehicle; `send` may be called from any thread.

    `on_message` and `on_turn` are called in the link's thread, the latter 20 times a second;
    `on_component` with every message of the vehicle's components that have `component_ids`;
    `healthy` before each heartbeat: no heartbeat without a working control loop. Every message
    before `adopt` counts as the vehicle's; from then on only those from its own address. After a
    silence it may have another one, if it `stands` on the ground or if packets are signed.
    """

    def __init__(
        self,
        name: str,
        settings: MavlinkSettings,
        *,
        on_message: Callable[[Message, float, Peer], None],
        on_turn: Callable[[float], None],
        on_component: Callable[[Message, float], None] = lambda *_: None,
        healthy: Callable[[float], bool],
        stands: Callable[[], bool],
        messages: Collection[str],
        equipment: Mapping[str, Collection[int]] = MappingProxyType({}),
        component_ids: frozenset[int] = frozenset(),
    ) -> None:
        """Prepare the link of robot `name`; raises ConfigError for a bad key. Opens nothing.

        `messages` are the names of those that the driver processes; those of a listener come on
        top. `equipment` has names of messages that equipment beside the autopilot brings, with ids
        of the components from which they are heard, too.
        """
        self.counts = LinkCounts()
        self._name = name
        self._settings = settings
        self._on_message = on_message
        self._on_turn = on_turn
        self._on_component = on_component
        self._healthy = healthy
        self.key = load_key(settings, name)
        """By which is signed what is sent; None: nothing is."""
        self._mav: Any = SignedCodec(None, settings.sender, settings.own_component)
        if self.key is not None:
            # Vehicles on one radio hear what is signed for each: none may seem another's replay.
            sign_with(self._mav, self.key, settings.system or 0)
        self._stands = stands
        self.pins = SenderPins(lambda: self.key is not None or stands(), component_ids)
        self._refused_at = -math.inf
        self._equipment = equipment
        self._wanted = {_MESSAGE_IDS[name] for name in (*messages, *equipment)}
        self._framers: dict[Peer, Framer] = {}
        self._lock = threading.Lock()
        self._listeners: list[tuple[frozenset[str], queue.SimpleQueue[Message]]] = []
        self._closing = threading.Event()
        self._turn_due = self._heartbeat_due = -math.inf
        self._thread: threading.Thread | None = None
        self._forwarder: Forwarder | None = None
        self._share: WireShare | None = None
        self.corrections: CorrectionsSource | None = None
        """Source of a base station's corrections, passed on while it is open."""

    def open(self) -> None:
        """Open the wire and start the thread; raises ConfigError and VehicleError."""
        settings = self._settings
        with contextlib.ExitStack() as opened:
            self._wire = self._opened_wire()
            opened.callback(self._wire.close)
            if settings.forward is not None:
                self._forwarder = Forwarder(settings.forward, self._name, self._stands)
                opened.callback(self._forwarder.close)
            if settings.corrections is not None and not settings.observe:
                opens = service("corrections.open")
                source: CorrectionsSource = opens(settings.corrections, self._name, self._correct)
                opened.callback(source.close)
                self.corrections = source
            self._bell, self._rope = map(opened.enter_context, socket.socketpair())
            self._resources = opened.pop_all()
        self._warn_if_exposed()
        self._start()

    def _opened_wire(self) -> Transport:
        """The wire, shared with this process' other vehicles there, if the system id is known."""
        settings = self._settings
        if settings.system is None:
            return open_transport(settings.url, self._name)
        self._share = share_wire(
            settings.url,
            self._name,
            settings.system,
            self,
            open_transport,
            hears_all=settings.forward is not None,
        )
        return self._share

    def _all_links(self) -> tuple[WireMember, ...]:
        """This vehicle's link, and those that share its wire."""
        return (self, *(self._share.others if self._share is not None else ()))

    def _is_foreign(self, system: int) -> bool:
        return self._share is not None and self._share.is_foreign(system)

    def _warn_if_exposed(self) -> None:
        if self.key is not None:
            return
        for url in filter(None, (self._settings.url, self._settings.forward)):
            if is_exposed(url):
                _log.warning(
                    "%s: %s is open to the network and nothing is signed: others there can fly the "
                    "drone, or forge what it reports; set a signing_key (docs/mavlink.md), or use "
                    "127.0.0.1",
                    self._name,
                    url,
                )

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._run, name=f"{self._name}-link", daemon=True)
        self._thread.start()

    @property
    def target(self) -> Sender:
        """System and component of the vehicle, which must be known by now."""
        target = self.pins.target
        assert target is not None  # noqa: S101 - nobody asks before it was adopted
        return target

    def adopt(self, target: Sender, peer: Peer, now: float) -> None:
        """Accept only this system's component as the vehicle, and only from its address.

        Args:
            target: System and component id.
            peer: Address that it speaks from.
            now: Monotonic clock, seconds.
        """
        self.pins.adopt(target, peer, now)

    def reports(self, now: float) -> list[str]:
        """Reports for the operator about unknown senders on the link, one sentence each."""
        said = self.pins.pin.reports(now)
        if self._forwarder is not None:
            said += self._forwarder.pin.reports(now)
        if self.corrections is not None:
            said += self.corrections.reports(now)
        if now - self._refused_at <= _TOLD:
            said.append("link: packets that are unsigned, wrongly signed or replayed are dropped")
        return said

    def send(self, message: Message) -> None:
        """Send a message to the vehicle, at once."""
        with self._lock:
            packet = message.pack(self._mav)
            self._mav.seq = (self._mav.seq + 1) % 256
            self.counts.sent += 1
            self._wire.send(packet, self._addressees())

    @contextmanager
    def listen(self, *names: str) -> Iterator[queue.SimpleQueue[Message]]:
        """Context manager: queue of the vehicle's messages of these names, such as `LOG_ENTRY`."""
        self._wanted.update(_MESSAGE_IDS[name] for name in names)
        entry: tuple[frozenset[str], queue.SimpleQueue[Message]] = (
            frozenset(names),
            queue.SimpleQueue(),
        )
        self._listeners = [*self._listeners, entry]
        try:
            yield entry[1]
        finally:
            self._listeners = [other for other in self._listeners if other is not entry]

    def close(self) -> None:
        """End the thread and close the wire."""
        self._closing.set()
        with contextlib.suppress(OSError):
            self._rope.send(b"!")
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        self._resources.close()

    def _correct(self, message: Message) -> None:
        """Pass corrections on to each vehicle on the wire: once where one packet reaches several.

        Called by the thread of the corrections.
        """
        links = [link for link in self._all_links() if link.pins.target is not None]
        for link in {(link.pins.pin.address, link.key): link for link in links}.values():
            link.send(message)

    def _addressees(self) -> tuple[Peer, ...]:
        if self.pins.target is not None:
            return (self.pins.pin.address,)
        return self.pins.addresses

    def _run(self) -> None:
        while not self._closing.is_set():
            self._wait(max(0.0, min(_TICK, self._turn_due - time.monotonic())))
            self.step(time.monotonic())

    def step(self, now: float) -> None:
        """Process received packets, and do the work due at `now`; called by the link's thread."""
        self._receive(now)
        if self._forwarder is not None:
            strangers = self._forwarder.strangers
            for packet in self._forwarder.receive(now):
                all_ways = (peer for link in self._all_links() for peer in link.pins.addresses)
                with self._lock:
                    self._wire.send(packet, tuple(dict.fromkeys(all_ways)))
            self.counts.strangers += self._forwarder.strangers - strangers
        if now >= self._turn_due:
            self._turn_due = now + _TICK
            self._on_turn(now)
        if now >= self._heartbeat_due and self._healthy(now):
            self._heartbeat_due = now + _HEARTBEAT
            self.send(self._heartbeat())

    def _wait(self, duration: float) -> None:
        wires = [self._wire.fileno(), self._bell.fileno()]
        if self._forwarder is not None:
            wires.append(self._forwarder.fileno())
        wait_readable(wires, duration)

    def _receive(self, now: float) -> None:
        for content, peer in self._wire.receive():
            framer = self._framer(peer)
            for message in framer.feed(content):
                self._route(message, peer, now)
            if peer is not None:
                framer.flush()
            if self._forwarder is not None and all(
                link.pins.may_pass(content, peer) for link in self._all_links()
            ):
                self._forwarder.send(content)
        self.counts.damaged = sum(framer.damaged for framer in self._framers.values())
        if self._mav.refused != self.counts.refused:
            self.counts.refused, self._refused_at = self._mav.refused, now

    def _framer(self, peer: Peer) -> Framer:
        if peer not in self._framers:
            if len(self._framers) >= _FRAMERS:
                known = {self.pins.pin.address}
                self._framers = {one: f for one, f in self._framers.items() if one in known}
            self._framers[peer] = Framer(self._wanted, self._decode, self._is_foreign)
        return self._framers[peer]

    def _decode(self, frame: bytearray) -> Message | None:
        with self._lock:
            return decoded(self._mav, frame)

    def _route(self, message: Message, peer: Peer, now: float) -> None:
        sender: Sender = (message.get_srcSystem(), message.get_srcComponent())
        target = self.pins.target
        if sender != target:
            self.pins.remember(sender, peer)
        if target is not None:
            if self.pins.carries(sender, peer):
                self._on_component(message, now)
                return
            if sender != target:
                if self._is_aboard(message, sender, target, peer):
                    self._on_message(message, now, peer)
                else:
                    self.counts.strangers += 1
                return
            beats = message.get_type() == "HEARTBEAT"
            if not self.pins.pin.admits(peer, now, may_lead=beats):
                self.counts.impostors += 1
                return
        self.counts.received += 1
        self._on_message(message, now, peer)
        for names, inbox in self._listeners:
            if message.get_type() in names:
                inbox.put(message)

    def _is_aboard(self, message: Message, sender: Sender, target: Sender, peer: Peer) -> bool:
        """Whether it is a word of the vehicle's own equipment, by the vehicle's own address."""
        components = self._equipment.get(message.get_type(), ())
        aboard = sender[0] == target[0] and sender[1] in components
        return aboard and peer == self.pins.pin.address

    def _heartbeat(self) -> Message:
        station = self._settings.heard_as_station
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS if station else mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            mavlink.MAV_STATE_ACTIVE,
            3,
        )

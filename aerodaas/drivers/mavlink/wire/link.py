"""Link to one vehicle: one thread that owns its wire, receives, and sends our heartbeats."""

from __future__ import annotations

import contextlib
import math
import queue
import select
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeAlias

from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import EventMessage, mavlink
from aerodaas.drivers.mavlink.wire.forwarding import Forwarder
from aerodaas.drivers.mavlink.wire.framing import Framer
from aerodaas.drivers.mavlink.wire.signing import load_key, sign_with, signature_fits
from aerodaas.drivers.mavlink.wire.transport import Peer, open_transport

__all__ = ["LinkCounts", "MavlinkLink", "Message"]

Message: TypeAlias = Any
"""One of pymavlink's, which has no types."""

_TICK = 0.05
"""Longest time between two turns of the thread, seconds."""
_HEARTBEAT = 1.0
_PEERS = 16
"""Senders remembered at most on one port."""

_WANTED = frozenset(
    {
        *(mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_SYS_STATUS),
        *(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, mavlink.MAVLINK_MSG_ID_PARAM_VALUE),
        *(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, mavlink.MAVLINK_MSG_ID_ATTITUDE),
        *(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT),
        *(mavlink.MAVLINK_MSG_ID_MISSION_COUNT, mavlink.MAVLINK_MSG_ID_MISSION_REQUEST),
        *(mavlink.MAVLINK_MSG_ID_MISSION_REQUEST_INT, mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT),
        *(mavlink.MAVLINK_MSG_ID_MISSION_ACK, mavlink.MAVLINK_MSG_ID_COMMAND_ACK),
        *(mavlink.MAVLINK_MSG_ID_HOME_POSITION, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE),
        *(mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION, mavlink.MAVLINK_MSG_ID_STATUSTEXT),
        *(mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT),
        *(mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, mavlink.MAVLINK_MSG_ID_VIBRATION),
        EventMessage.id,
    }
)


@dataclass(slots=True)
class LinkCounts:
    """Counters of the wire."""

    received: int = 0
    """Packets of the vehicle that were decoded."""
    damaged: int = 0
    """Invalid bytes and packets, and those with an invalid signature."""
    strangers: int = 0
    """Packets of other systems and components."""
    sent: int = 0


class MavlinkLink:
    """Link to one vehicle; `send` may be called from any thread.

    `on_message` and `on_turn` are called in the link's thread, the latter 20 times a second, and
    `healthy` before each heartbeat: no heartbeat without a working control loop. Every message
    before `adopt` counts as the vehicle's.
    """

    def __init__(
        self,
        name: str,
        settings: MavlinkSettings,
        *,
        on_message: Callable[[Message, float], None],
        on_turn: Callable[[float], None],
        healthy: Callable[[float], bool],
    ) -> None:
        """Prepare the link of robot `name`; raises ConfigError for a bad key. Opens nothing."""
        self.counts = LinkCounts()
        self.target: tuple[int, int] | None = None
        """System and component of the vehicle, once it is known."""
        self._name = name
        self._settings = settings
        self._on_message = on_message
        self._on_turn = on_turn
        self._healthy = healthy
        self._key = load_key(settings, name)
        self._mav: Any = mavlink.MAVLink(None, settings.own_system, settings.own_component)
        if self._key is not None:
            sign_with(self._mav, self._key)
        self._framers: dict[Peer, Framer] = {}
        self._peers: dict[int, Peer] = {}
        self._lock = threading.Lock()
        self._listeners: list[tuple[frozenset[str], queue.SimpleQueue[Message]]] = []
        self._closing = threading.Event()
        self._turn_due = self._heartbeat_due = -math.inf
        self._thread: threading.Thread | None = None
        self._forwarder: Forwarder | None = None

    def open(self) -> None:
        """Open the wire and start the thread; raises ConfigError and VehicleError."""
        settings = self._settings
        with contextlib.ExitStack() as opened:
            self._wire = open_transport(settings.url, self._name)
            opened.callback(self._wire.close)
            if settings.forward is not None:
                self._forwarder = Forwarder(settings.forward, self._name)
                opened.callback(self._forwarder.close)
            self._bell, self._rope = map(opened.enter_context, socket.socketpair())
            self._resources = opened.pop_all()
        self._start()

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._run, name=f"{self._name}-link", daemon=True)
        self._thread.start()

    def adopt(self, system: int, component: int) -> None:
        """Accept only this system's component as the vehicle."""
        self.target = (system, component)

    def send(self, message: Message) -> None:
        """Send a message to the vehicle, at once."""
        with self._lock:
            packet = message.pack(self._mav)
            self._mav.seq = (self._mav.seq + 1) % 256
            self.counts.sent += 1
            self._wire.send(packet, self._addressees())

    @contextmanager
    def listen(self, *names: str) -> Iterator[queue.SimpleQueue[Message]]:
        """Context manager: queue of the vehicle's messages of these names."""
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

    def _addressees(self) -> tuple[Peer, ...]:
        target = self.target
        if target is not None and target[0] in self._peers:
            return (self._peers[target[0]],)
        return tuple(dict.fromkeys(self._peers.values()))

    def _run(self) -> None:
        while not self._closing.is_set():
            self._wait(max(0.0, min(_TICK, self._turn_due - time.monotonic())))
            self.turn(time.monotonic())

    def turn(self, now: float) -> None:
        """Process received packets, and do the work due at `now`; called by the link's thread."""
        self._hear(now)
        if self._forwarder is not None:
            for packet in self._forwarder.receive():
                with self._lock:
                    self._wire.send(packet, tuple(dict.fromkeys(self._peers.values())))
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
        with contextlib.suppress(OSError, ValueError):
            select.select([wire for wire in wires if wire >= 0], [], [], duration)

    def _hear(self, now: float) -> None:
        for content, peer in self._wire.receive():
            if self._forwarder is not None:
                self._forwarder.send(content)
            framer = self._framer(peer)
            for message in framer.feed(content):
                self._take(message, peer, now)
            if peer is not None:
                framer.flush()
        self.counts.damaged = sum(framer.damaged for framer in self._framers.values())

    def _framer(self, peer: Peer) -> Framer:
        if peer not in self._framers:
            if len(self._framers) >= _PEERS:
                known = set(self._peers.values())
                self._framers = {one: f for one, f in self._framers.items() if one in known}
            self._framers[peer] = Framer(_WANTED, self._decode)
        return self._framers[peer]

    def _decode(self, frame: bytearray) -> Message | None:
        if self._key is not None and not signature_fits(self._key, frame):
            return None
        try:
            with self._lock:
                message = self._mav.decode(frame)
        except mavlink.MAVError:
            return None
        return None if message.get_type().startswith("UNKNOWN") else message

    def _take(self, message: Message, peer: Peer, now: float) -> None:
        system = message.get_srcSystem()
        if system in self._peers or len(self._peers) < _PEERS:
            self._peers[system] = peer
        if self.target not in {None, (system, message.get_srcComponent())}:
            self.counts.strangers += 1
            return
        self.counts.received += 1
        self._on_message(message, now)
        for names, inbox in self._listeners:
            if message.get_type() in names:
                inbox.put(message)

    def _heartbeat(self) -> Message:
        ours = self._settings.role == "ground_station"
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_GCS if ours else mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            mavlink.MAV_STATE_ACTIVE,
            3,
        )

"""Link to one Tello: one thread that owns its sockets, and the handshake by which it begins."""

from __future__ import annotations

import contextlib
import errno
import logging
import math
import os
import queue
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from aerodaas.drivers.pin import Pin
from aerodaas.errors import AeroDaaSError, VehicleError
from aerodaas.extensions.tello.commands import (
    ENTER,
    STILL,
    STREAM_ON,
    VERSION,
    Command,
    Sticks,
    ports,
)
from aerodaas.extensions.tello.dead_man import DeadMan
from aerodaas.extensions.tello.settings import STATE_PORT, VIDEO_PORT, TelloSettings
from aerodaas.extensions.tello.state import TelloState, parse_state

__all__ = [
    "LinkCounts",
    "TelloLink",
    "bound_socket",
    "datagrams",
    "explain_no_states",
    "greet",
    "meaning",
]

_LARGEST = 65535
_AT_ONCE = 256
"""Most datagrams received in one turn."""


def bound_socket(
    place: str,
    port: int,
    *,
    address: str = "",
    interface: str = "",
    receive_buffer: int | None = None,
    raises: type[AeroDaaSError],
) -> socket.socket:
    """Open a non-blocking UDP socket of this host.

    Args:
        place: What needs it, for errors.
        port: 0 for any.
        address: Of this host; empty for all.
        interface: Network interface; empty for any.
        receive_buffer: Bytes; None for the system's default.
        raises: Class of the error where it cannot be opened.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.settimeout(0.0)
        if receive_buffer is not None:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        if interface:
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, interface.encode())
        opened.bind((address, port))
    except OSError as error:
        opened.close()
        raise raises(f"{place}: {_explain(error, address, port, interface)}") from None
    return opened


def _explain(error: OSError, address: str, port: int, interface: str) -> str:
    if error.errno == errno.EADDRINUSE:
        return (
            f"UDP port {port} is taken by another program or another Tello of this host; "
            f"`ss -ulnp sport = :{port}` shows by whom (docs/tello.md: several Tellos)"
        )
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{address} is no address of this host; `ip address` lists them"
    if error.errno == errno.ENODEV:
        return f"no network interface is called {interface!r}; `ip link` lists them"
    if error.errno in {errno.EPERM, errno.EACCES}:
        return f"not allowed to use UDP port {port} {interface}: {os.strerror(error.errno)}"
    return f"cannot open UDP port {port}: {error.strerror or error}"


def datagrams(source: socket.socket) -> list[tuple[bytes, str, int]]:
    """Received datagrams: content, sender's address, sender's port; never blocks."""
    arrived = []
    for _ in range(_AT_ONCE):
        try:
            content, (address, port) = source.recvfrom(_LARGEST)
        except BlockingIOError:
            break
        except ConnectionError:
            # The system reports here that an earlier datagram reached no socket.
            continue
        arrived.append((content, address, port))
    return arrived


_log = logging.getLogger(__name__)

_TICK = 0.05
"""Longest time between two turns of the thread, seconds."""
_STALE_STICKS = 0.3
"""Seconds after which sticks that are not renewed are centred: six turns of the loop."""
_CENTRINGS = 3
"""Number of centring `rc` packets, which have no reply; then the link is silent."""
_SETTLE = 0.1
"""Seconds between a reply and the next command: a Tello misses commands in quick succession,
and a duplicate of the reply must not be taken for the next one's."""
_SETTLE_LATE = 0.5
"""The same after a missing reply, which may still arrive."""


@dataclass(slots=True)
class LinkCounts:
    """Counters of the wire."""

    states: int = 0
    malformed: int = 0
    """State packets and replies that could not be parsed."""
    strangers: int = 0
    """Packets of other addresses and ports."""
    stray_replies: int = 0
    """Late, duplicate and unexpected replies."""
    timeouts: int = 0
    """Requests without a reply."""
    sticks: int = 0
    """`rc` commands sent."""


Done = Callable[[str | None], None]
"""Called in the link's thread with the reply to a command, or None without one."""


@dataclass(slots=True)
class _Pending:
    command: Command
    done: Done
    tries: int = 0
    deadline: float = 0.0


class TelloLink:
    """Link that sends commands one after the other and `rc` as it is set, and receives states.

    `request` and `steer` return at once. `on_state` and `on_turn` are called in the link's
    thread, the latter 20 times a second. The link sends nothing by itself except the
    centring of sticks that are not renewed: when the setpoint loop stops, so does the link.
    """

    def __init__(
        self,
        name: str,
        settings: TelloSettings,
        on_state: Callable[[TelloState, float], None],
        on_turn: Callable[[float], None],
    ) -> None:
        """Prepare the link of the robot `name`; nothing is opened yet."""
        self.counts = LinkCounts()
        self.failure: OSError | None = None
        """Error of the latest packet; None if it was sent."""
        self.flown = STILL
        """The sticks as they were last sent."""
        self._name = name
        self._settings = settings
        self._peer = (settings.address, settings.command_port)
        self._state_pin = Pin("the Tello", lambda: True)
        self._on_state = on_state
        self._on_turn = on_turn
        self._lock = threading.Lock()
        self._queue: deque[_Pending] = deque()
        self._pending: _Pending | None = None
        self._quiet_until = 0.0
        self._sticks: Sticks | None = None
        self._steered_at = 0.0
        self._centrings = 0
        self._turn_due = -math.inf
        self._closing = threading.Event()
        self._thread: threading.Thread | None = None

    def open(self) -> None:
        """Open the sockets and start the thread; raises VehicleError for a port that is taken."""
        settings, name = self._settings, self._name
        with contextlib.ExitStack() as opened:
            self._commands = opened.enter_context(
                bound_socket(
                    f"{name}, commands",
                    settings.local_port,
                    address=settings.local_address,
                    interface=settings.interface,
                    raises=VehicleError,
                )
            )
            self._states = opened.enter_context(
                bound_socket(
                    f"{name}, state",
                    settings.state_port,
                    address=settings.local_address,
                    interface=settings.interface,
                    raises=VehicleError,
                )
            )
            self._bell, self._rope = map(opened.enter_context, socket.socketpair())
            self._bell.settimeout(0.0)
            self._rope.settimeout(0.0)
            self._guard = DeadMan(self._commands, self._peer)
            opened.callback(self._guard.close)
            self._resources = opened.pop_all()
        self._start()

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._run, name=f"{self._name}-link", daemon=True)
        self._thread.start()

    def request(self, command: Command, done: Done, *, urgent: bool = False) -> None:
        """Send `command` after those before it.

        Args:
            command: The command.
            done: Called with its outcome.
            urgent: Whether it is sent at once; those before it are dropped.
        """
        with self._lock:
            if urgent:
                self._queue.clear()
                self._pending = None
                self._quiet_until = 0.0
            self._queue.append(_Pending(command, done))
        self._ring()

    def steer(self, sticks: Sticks) -> None:
        """Set the sticks, until the next call or the timeout."""
        with self._lock:
            self._sticks = sticks
            self._steered_at = time.monotonic()
        self._ring()

    def release(self) -> None:
        """Stop sending `rc`: the Tello flies by itself (take-off, landing)."""
        with self._lock:
            self._sticks = None
            self.flown = STILL
            self._centrings = 0
        self._guard.restart(moving=False)

    def close(self, last: Command | None = None) -> None:
        """Send `last` without waiting for its reply, end the thread and free the ports."""
        self._closing.set()
        self._ring()
        if self._thread is not None:
            self._thread.join(timeout=2.0)
        if last is not None:
            self._transmit(last.text)
        self._resources.close()

    def _ring(self) -> None:
        with contextlib.suppress(OSError):
            self._rope.send(b"!")

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            for source in (self._commands, self._states, self._bell):
                selector.register(source, selectors.EVENT_READ)
            while not self._closing.is_set():
                selector.select(max(0.0, min(_TICK, self._turn_due - time.monotonic())))
                with contextlib.suppress(BlockingIOError):
                    self._bell.recv(4096)
                self.step()

    def step(self) -> None:
        """Process received packets, and send what is due; called by the link's thread."""
        self._receive()
        now = time.monotonic()
        self._speak(now)
        self._fly(now)
        if now >= self._turn_due:
            self._turn_due = now + _TICK
            self._on_turn(now)

    def _receive(self) -> None:
        for content, address, port in datagrams(self._commands):
            if (address, port) == self._peer:
                self._take_reply(content)
            else:
                self.counts.strangers += 1
        for content, address, port in datagrams(self._states):
            now = time.monotonic()
            if address != self._peer[0] or not self._state_pin.admits((address, port), now):
                self.counts.strangers += 1
                continue
            state = parse_state(content)
            if state is None:
                self.counts.malformed += 1
                _log.debug("%s: not a state packet: %r", self._name, content[:80])
                continue
            self.counts.states += 1
            self._on_state(state, now)

    def _take_reply(self, content: bytes) -> None:
        try:
            reply = content.decode("ascii").strip()
        except UnicodeDecodeError:
            self.counts.malformed += 1
            return
        with self._lock:
            pending = self._pending
            if pending is None or not pending.command.accepts(reply):
                self.counts.stray_replies += 1
                return
            self._pending = None
            self._quiet_until = time.monotonic() + _SETTLE
        pending.done(reply)

    def _speak(self, now: float) -> None:
        """Send the next command, repeat the present one, or give it up."""
        given_up = None
        with self._lock:
            pending = self._pending
            if pending is not None and now >= pending.deadline:
                self.counts.timeouts += 1
                self._pending = None
                self._quiet_until = now + _SETTLE_LATE
                if pending.tries < pending.command.tries:
                    self._queue.appendleft(pending)
                else:
                    given_up = pending
            if self._pending is None and self._queue and now >= self._quiet_until:
                self._pending = pending = self._queue.popleft()
                pending.tries += 1
                pending.deadline = now + pending.command.timeout
                self._transmit(pending.command.text)
        if given_up is not None:
            _log.warning("%s: no reply to %r", self._name, given_up.command.text)
            given_up.done(None)

    def _fly(self, now: float) -> None:
        """Send the sticks once each time they are set; centre them after the timeout."""
        with self._lock:
            sticks, self._sticks = self._sticks, None
            if sticks is None:
                stale = now - self._steered_at > _STALE_STICKS
                if not stale or self._centrings == 0:
                    return
                self._centrings -= 1
                self._steered_at = now
                sticks = STILL
            else:
                self._centrings = _CENTRINGS
            self.flown = sticks
            self._transmit(sticks.text)
            self.counts.sticks += 1
        self._guard.restart(moving=sticks != STILL)

    def _transmit(self, text: str) -> None:
        try:
            self._commands.sendto(text.encode("ascii"), self._peer)
        except OSError as error:
            # Wi-Fi is unreliable; a lost packet shows as a missing reply or state.
            self.failure = error
        else:
            self.failure = None


_MEANINGS = {
    "motor stop": "the battery is low, a propeller is blocked, or it was tilted: charge it, look",
    "no valid imu": "it cannot see the ground: give it light and a floor with a pattern, or "
    "calibrate it in the Tello app",
    "not joystick": "it cannot do this in the air as things stand",
    "auto land": "it is landing by itself: low battery, heat, or 15 s without a command",
    "out of range": "beyond the ranges of the SDK",
    "unknown command": "its firmware does not know it: update it in the Tello app",
}

_REFUSALS = 2


def meaning(reply: str) -> str:
    """Meaning of refusals whose texts are known from reports of users."""
    for words, text in _MEANINGS.items():
        if words in reply.lower():
            return text
    return "it gives no reason; battery, heat and level ground are the usual ones"


def greet(
    link: TelloLink,
    name: str,
    settings: TelloSettings,
    video_port: int | None,
    deadline: float,
) -> None:
    """Enter SDK mode, set ports that are not the default ones, switch the video on.

    Args:
        link: The link to the Tello.
        name: Id of the robot, for errors.
        settings: Ports of this host.
        video_port: Port for video; None leaves the video off.
        deadline: Monotonic seconds by which it returns or raises.

    Raises:
        VehicleError: If the Tello does not answer, or refuses.
    """
    if _ask(link, ENTER, deadline) is None:
        raise VehicleError(_explain_silence(link, name, settings))
    video = VIDEO_PORT if video_port is None else video_port
    if (settings.state_port, video) != (STATE_PORT, VIDEO_PORT):
        reply = _ask(link, ports(settings.state_port, video), deadline)
        if reply is None or not Command.succeeded(reply):
            version = _ask(link, VERSION, deadline) or "unknown"
            raise VehicleError(
                f"{name}: the Tello answered {reply!r} when told to send to the ports "
                f"{settings.state_port} and {video}: this needs SDK 3.0, and it has version "
                f'{version}. Use the default ports, and "local_address" or "interface" to tell '
                "several Tellos apart"
            )
    if video_port is not None:
        reply = _ask(link, STREAM_ON, deadline)
        if reply is None or not Command.succeeded(reply):
            answer = "did not answer" if reply is None else f"answered {reply!r}"
            raise VehicleError(f"{name}: the Tello {answer} when told to send video")


def _ask(link: TelloLink, command: Command, deadline: float) -> str | None:
    """The reply to `command`; None after the timeout.

    Only `command` itself is repeated until the timeout; also after a refusal, as the request or
    the reply may have been garbled.
    """
    answers: queue.SimpleQueue[str | None] = queue.SimpleQueue()
    reply, refusals = None, 0
    while (left := deadline - time.monotonic()) > 0.0 and refusals < _REFUSALS:
        link.request(command, answers.put)
        try:
            reply = answers.get(timeout=left)
        except queue.Empty:
            return None
        if reply is not None and Command.succeeded(reply):
            break
        refusals += reply is not None or command is not ENTER
    return reply


def _explain_silence(link: TelloLink, name: str, settings: TelloSettings) -> str:
    if link.failure is not None:
        return (
            f"{name}: nothing can be sent to {settings.address}: {link.failure.strerror}; "
            "join the Tello's Wi-Fi (TELLO-…), or set its address"
        )
    if link.counts.strangers:
        return (
            f"{name}: {settings.address} does not answer, but {link.counts.strangers} packets came "
            "from elsewhere: set the Tello's address"
        )
    return (
        f"{name}: no answer from {settings.address}:{settings.command_port}; is the Tello switched "
        "on (light flashing yellow), this host in its Wi-Fi (TELLO-…), no other program or phone "
        f"connected to it, and the firewall open for replies (`ping {settings.address}`)?"
    )


def explain_no_states(link: TelloLink, name: str, settings: TelloSettings) -> str:
    """Reason why no state packet arrives although the Tello replies to commands.

    Args:
        link: The link to the Tello.
        name: Id of the robot, for the text.
        settings: The port for states.
    """
    port, counts = settings.state_port, link.counts
    if counts.malformed:
        return (
            f"{name}: {counts.malformed} packets came to UDP port {port}, none of which is a "
            "state packet of a Tello; update its firmware in the Tello app"
        )
    elsewhere = f" ({counts.strangers} came from elsewhere)" if counts.strangers else ""
    return (
        f"{name}: the Tello answers but no state packet came to UDP port {port}{elsewhere}; open "
        f"the firewall (`sudo ufw allow {port}/udp`), and end other programs that use a Tello"
    )

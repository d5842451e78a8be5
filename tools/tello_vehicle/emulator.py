"""EmulatedTello: the SDK's ports on loopback, in real time."""

from __future__ import annotations

import contextlib
import logging
import selectors
import time

from aerodaas.errors import VehicleError
from aerodaas.extensions.tello.link import bound_socket, datagrams
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.simulation.dynamics import STEP
from aerodaas.testing.channel import Channel, Impairment
from tools.emulated import LONGEST_LEAP, EmulatedVehicle
from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.options import TelloOptions
from tools.tello_vehicle.sdk import Outcome, TelloSdk
from tools.tello_vehicle.video import VideoStream

__all__ = ["EmulatedTello"]

_log = logging.getLogger(__name__)

_TURN = 0.02
_STATE_PERIOD = 0.1
_SILENCE = 15.0
"""Seconds without a command after which a flying Tello lands."""
_HOT = 90.0
"""Degrees Celsius at which `takeoff` is refused."""


class EmulatedTello(EmulatedVehicle[TelloFlight]):
    """A Tello on loopback, from `start` (or `with`) to `stop`.

    It replies to the last sender, as the real one does, and sends state and video there.
    """

    kind = "emulated-tello"

    def __init__(self, options: TelloOptions | None = None) -> None:
        """Open the command port, so that `port` is known at once; raises VehicleError if taken."""
        self.options = options or TelloOptions()
        self.heard: list[tuple[float, str]] = []
        """Every command that arrived, with its monotonic second."""
        opened = bound_socket(
            "emulated Tello", self.options.port, address=self.options.address, raises=VehicleError
        )
        super().__init__(opened, TelloFlight(self.options))
        self._sdk = TelloSdk(self.options, self._flight)
        seed = self.options.seed
        self._ears = Channel(self.options.commands, f"{seed}/commands", self._obey)
        self._replies = Channel(self.options.replies, f"{seed}/replies", self._transmit)
        self._states = Channel(self.options.states, f"{seed}/states", self._transmit)
        self._client: tuple[str, int] | None = None
        self._awaiting: tuple[str, int] | None = None
        """The client that gets `ok` once the motion under way is done."""
        self._idle_since = time.monotonic()
        self._video: VideoStream | None = None

    @property
    def film_began(self) -> float | None:
        """Monotonic second at which the film under way began; None without one."""
        video = self._video
        return None if video is None else video.began

    def spoil(
        self,
        *,
        commands: Impairment | None = None,
        replies: Impairment | None = None,
        states: Impairment | None = None,
    ) -> None:
        """Change the given impairments of the radio link."""
        for channel, impairment in (
            (self._ears, commands),
            (self._replies, replies),
            (self._states, states),
        ):
            if impairment is not None:
                channel.impairment = impairment

    def _release(self) -> None:
        if self._video is not None:
            self._video.stop()

    def _run(self) -> None:
        began = time.monotonic()
        flown = 0
        state_due = began
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_READ)
            while not self._stopping.is_set():
                selector.select(_TURN)
                now = time.monotonic()
                for content, address, port in datagrams(self._socket):
                    self._ears.send(content, (address, port), now)
                self._ears.deliver(now)
                steps = int((now - began) / STEP) - flown
                flown += steps
                with self._lock:
                    self._flight.advance(min(steps * STEP, LONGEST_LEAP))
                self._conclude(now)
                if now >= state_due:
                    state_due = now + _STATE_PERIOD
                    self._report(now)
                for channel in (self._replies, self._states):
                    channel.deliver(now)

    def _obey(self, content: bytes, client: tuple[str, int]) -> None:
        now = time.monotonic()
        text = content.decode("ascii", errors="replace").strip()
        self.heard.append((now, text))
        self._idle_since = now
        with self._lock:
            before = self._sdk.streaming
            outcome = self._refused(text) or self._sdk.handle(text)
            entered, streaming = self._sdk.entered, self._sdk.streaming
        if not entered:
            return
        self._client = client
        if outcome.moves or text in {"stop", "emergency"}:
            self._dismiss(now)
        if outcome.moves:
            self._awaiting = client
        if outcome.reply is not None:
            self._replies.send(outcome.reply.encode("ascii", errors="replace"), client, now)
        if streaming != before:
            self._switch_video(on=streaming)

    def _refused(self, text: str) -> Outcome | None:
        hot = self.options.temperature >= _HOT
        return Outcome("error Motor stop") if hot and text == "takeoff" else None

    def _dismiss(self, now: float) -> None:
        """Handle a motion that another command has interrupted."""
        if self._awaiting is not None:
            self._replies.send(b"error", self._awaiting, now)
            self._awaiting = None

    def _conclude(self, now: float) -> None:
        """Reply to a finished motion; land after a long silence of the client."""
        with self._lock:
            settled, flying, mode = self._flight.settled, self._flight.flying, self._flight.mode
        if self._awaiting is not None:
            self._idle_since = now
            if settled:
                self._replies.send(b"ok", self._awaiting, now)
                self._awaiting = None
        landing = mode in {VehicleMode.LANDING, VehicleMode.FAILSAFE}
        if flying and not landing and now - self._idle_since > _SILENCE:
            _log.info("no command for %g s: landing", _SILENCE)
            with self._lock:
                self._flight.land()

    def _report(self, now: float) -> None:
        if self._client is None:
            return
        with self._lock:
            state, port = self._flight.state(), self._sdk.ports[0]
        self._states.send(state.encode("ascii"), (self._client[0], port), now)

    def _switch_video(self, *, on: bool) -> None:
        if self._video is not None:
            self._video.stop()
            self._video = None
        if on and self._client is not None:
            peers = ((self._client[0], self._sdk.ports[1]), *self.options.video.copies)
            self._video = VideoStream(self.options, peers, lambda: self.truth)
            self._video.start()

    def _transmit(self, content: bytes, peer: tuple[str, int]) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(content, peer)

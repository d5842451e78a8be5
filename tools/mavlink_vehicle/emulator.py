"""EmulatedAutopilot: one vehicle on UDP, in real time."""

from __future__ import annotations

import contextlib
import selectors
import socket
import time
from collections.abc import Callable
from typing import Any, TypeAlias

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.signing import sign_with
from aerodaas.geometry.frames import Vector
from aerodaas.simulation.dynamics import STEP
from aerodaas.testing.channel import Channel, Impairment
from tools.emulated import LONGEST_LEAP, EmulatedVehicle
from tools.mavlink_vehicle.actuators import SILENT
from tools.mavlink_vehicle.ardupilot import EmulatedArduPilot
from tools.mavlink_vehicle.components import EmulatedComponent
from tools.mavlink_vehicle.firmware import Firmware
from tools.mavlink_vehicle.flight import MavFlight
from tools.mavlink_vehicle.options import AutopilotOptions
from tools.mavlink_vehicle.px4 import EmulatedPX4
from tools.mavlink_vehicle.store import LogStore, ParameterStore, PlanStore, TimeKeeper
from tools.mavlink_vehicle.transmitter import EmulatedTransmitter

__all__ = ["EmulatedAutopilot"]

_TURN = 0.01
_LARGEST = 65535
_HEARTBEAT = 1.0
_ROUNDING = 1e-6
_Answerer: TypeAlias = ParameterStore | PlanStore | LogStore | TimeKeeper
_STORED: dict[str, Callable[[Firmware], _Answerer]] = {
    **dict.fromkeys(
        ("PARAM_REQUEST_LIST", "PARAM_REQUEST_READ", "PARAM_SET"),
        lambda firmware: firmware.parameters,
    ),
    **dict.fromkeys(
        (
            "MISSION_CLEAR_ALL",
            "MISSION_COUNT",
            "MISSION_ITEM_INT",
            "MISSION_REQUEST_INT",
            "MISSION_REQUEST_LIST",
        ),
        lambda firmware: firmware.plans,
    ),
    **dict.fromkeys(("LOG_REQUEST_DATA", "LOG_REQUEST_LIST"), lambda firmware: firmware.logs),
    "TIMESYNC": lambda firmware: firmware.time_keeper,
}
"""What answers to a message."""


class EmulatedAutopilot(EmulatedVehicle[MavFlight]):
    """PX4 or ArduCopter on loopback, from `start` (or `with`) to `stop`.

    It sends to `options.peer` at once, and to everybody who has spoken to it since.
    """

    kind = "emulated-autopilot"

    def __init__(self, options: AutopilotOptions | None = None) -> None:
        """Open a port of its own."""
        self.options = options or AutopilotOptions()
        self.heard: list[tuple[float, Any]] = []
        """Every message that arrived whole, with the second at which it did."""
        opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        opened.settimeout(0.0)
        opened.bind(("127.0.0.1", 0))
        super().__init__(opened, MavFlight(self.options))
        self._peers: set[tuple[str, int]] = {self.options.peer}
        kind = EmulatedPX4 if self.options.family == "px4" else EmulatedArduPilot
        self.firmware: Firmware = kind(self.options, self._flight, self._say)
        self._mav = self._codec(1)
        self._codecs = {1: self._mav}
        """One for each component, with its own numbers and signatures."""
        self.transmitter = EmulatedTransmitter(
            lambda message: self._say_as(message, EmulatedTransmitter.component),
            present=self.options.remote_id,
        )
        self.components = {
            number: EmulatedComponent(self.firmware, number, self._say_as)
            for number in self.options.components
        }
        """Cameras and gimbals with ids of their own."""
        seed = self.options.seed
        self._up = Channel(self.options.uplink, f"{seed}/up", self._hear)
        self._down = Channel(self.options.downlink, f"{seed}/down", self._transmit)
        self._due: dict[int, float] = {}
        self._beat_due = 0.0
        self._now = 0.0
        """Seconds of the latest turn."""
        self._flown_to: float | None = None

    def _codec(self, component: int) -> Any:  # noqa: ANN401 - pymavlink has no types
        codec = mavlink.MAVLink(None, self.options.system, component)
        codec.robust_parsing = True
        if self.options.key is not None:
            sign_with(codec, self.options.key)
        return codec

    @property
    def armed(self) -> bool:
        """Whether its motors turn."""
        with self._lock:
            return self.firmware.armed

    def take_over(self) -> None:
        """Let a pilot fly."""
        with self._lock:
            firmware = self.firmware
            assert isinstance(firmware, EmulatedPX4 | EmulatedArduPilot)  # noqa: S101 - all there are
            firmware.take_over()

    def protect_itself(self) -> None:
        """Let its own protection take it home."""
        with self._lock:
            self.firmware.enter_return()

    def stop_motors(self) -> None:
        """Use the kill switch."""
        with self._lock:
            self.firmware.stop_motors()

    def restart(self) -> None:
        """Have the autopilot start anew, in flight or not."""
        with self._lock:
            self.firmware.restart()
            self._due.clear()

    def freeze(self, *, off: bool = False) -> None:
        """Let the stamps of its telemetry stand still while packets go on, or let them run."""
        with self._lock:
            self.firmware.frozen_at = None if off else int(self.firmware.now * 1e3)

    def lose_gps(self, *, off: bool = False) -> None:
        """Let its GPS have no fix, or have one again."""
        with self._lock:
            self.firmware.lose_gps(off=off)

    def shift_frame(self, by: Vector) -> None:
        """Let its local position jump by `by` (NED metres), while it flies on."""
        with self._lock:
            self._flight.shift_frame(by)

    def spoil(self, *, up: Impairment | None = None, down: Impairment | None = None) -> None:
        """Change how bad the link is from now on, for each way that is given."""
        if up is not None:
            self._up.impairment = up
        if down is not None:
            self._down.impairment = down

    def cut(self, *, off: bool = True) -> None:
        """Cut the link, or mend it."""
        impairment = Impairment(loss=1.0 if off else 0.0)
        self.spoil(up=impairment, down=impairment)

    def inject(self, content: bytes) -> None:
        """Send these bytes to everybody, as they are."""
        with self._lock:
            for peer in self._peers:
                self._transmit(content, peer)

    def _run(self) -> None:
        with selectors.DefaultSelector() as selector:
            selector.register(self._socket, selectors.EVENT_READ)
            while not self._stopping.is_set():
                selector.select(_TURN)
                self.turn(time.monotonic())

    def turn(self, now: float) -> None:
        """Hear, fly and talk at `now` seconds of a clock that need not be the wall's."""
        with self._lock:
            self._now = now
            self._flown_to = now if self._flown_to is None else self._flown_to
            self._receive(now)
            self._up.deliver(now)
            steps = int((now - self._flown_to) / STEP + _ROUNDING)
            self._flown_to += steps * STEP
            self.firmware.advance(min(steps * STEP, LONGEST_LEAP))
            for component in self.components.values():
                component.turn(now)
            self._report(now)
            self._down.deliver(now)

    def _receive(self, now: float) -> None:
        while True:
            try:
                content, (address, port) = self._socket.recvfrom(_LARGEST)
            except BlockingIOError:
                return
            except OSError:
                continue
            self._peers.add((address, port))
            self._up.send(content, (address, port), now)

    def _hear(self, content: bytes, peer: tuple[str, int]) -> None:
        del peer
        messages = self._mav.parse_buffer(content) or []
        for message in messages:
            if message.get_type() != "BAD_DATA":
                self.heard.append((self._now, message))
                self._pass_on(message)

    def _pass_on(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Give a message for this vehicle to whom of its components it is for."""
        if getattr(message, "target_system", 0) not in {0, self.options.system}:
            return
        self.transmitter.hear(message, self._now)
        component = self.components.get(getattr(message, "target_component", 0))
        if component is not None:
            component.hear(message)
        else:
            self._obey(message)

    def _obey(self, message: Any) -> None:  # noqa: ANN401 - as above
        kind = message.get_type()
        firmware = self.firmware
        if kind == "COMMAND_LONG":
            values = tuple(getattr(message, f"param{index}") for index in range(1, 8))
            result = firmware.obey(message.command, values, None)
            if result != SILENT:
                self._acknowledge(message, result)
        elif kind == "COMMAND_INT":
            values = tuple(getattr(message, f"param{index}") for index in range(1, 5))
            values += (message.x, message.y, message.z)
            self._acknowledge(message, firmware.obey(message.command, values, message.frame))
        elif kind == "SET_POSITION_TARGET_LOCAL_NED":
            firmware.setpoint(message)
        elif kind == "GIMBAL_MANAGER_SET_PITCHYAW":
            firmware.payload.track(message)
        elif kind in _STORED:
            for answer in _STORED[kind](firmware).handle(message):
                self._say(answer)
        elif kind == "MISSION_SET_CURRENT" and firmware.route.select(message.seq):
            self._say(firmware.route.current())
        elif kind == "HEARTBEAT" and isinstance(firmware, EmulatedArduPilot):
            firmware.hear_heartbeat(message)

    def _acknowledge(self, message: Any, result: int) -> None:  # noqa: ANN401
        peer = (message.get_srcSystem(), message.get_srcComponent())
        for _ in range(2 if self.options.family == "px4" else 1):
            self._say(mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *peer))

    def _report(self, now: float) -> None:
        if now >= self._beat_due:
            self._beat_due = now + _HEARTBEAT
            self._say(self.firmware.heartbeat())
        for number, rate in self.firmware.rates.items():
            if rate <= 0.0 or now < self._due.get(number, 0.0):
                continue
            self._due[number] = max(now, self._due.get(number, now) + 1.0 / rate)
            message = self.firmware.message(number)
            if message is not None:
                self._say(message)
        self.transmitter.turn(now)

    def _say(self, message: Any) -> None:  # noqa: ANN401
        self._say_as(message, 1)

    def _say_as(self, message: Any, component: int) -> None:  # noqa: ANN401
        if component not in self._codecs:
            self._codecs[component] = self._codec(component)
        codec = self._codecs[component]
        packet = message.pack(codec)
        codec.seq = (codec.seq + 1) % 256
        for peer in self._peers:
            self._down.send(packet, peer, self._now)

    def _transmit(self, content: bytes, peer: tuple[str, int]) -> None:
        with contextlib.suppress(OSError):
            self._socket.sendto(content, peer)

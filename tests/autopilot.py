"""One scripted autopilot for all MAVLink tests, on a clock that the test moves.

`ScriptedAutopilot` is the peer: its script says what it answers, and to what it stays silent; it
records what it received.
"""

from __future__ import annotations

import contextlib
import queue
import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from types import SimpleNamespace
from typing import Any, Literal, TypeAlias

import numpy as np
import pytest

from aerodaas.config.extensions import added
from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire import link as link_module
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.drivers.pin import Peer
from aerodaas.messages.vehicle import VelocitySetpoint

__all__ = [
    "ACCEPTED",
    "ARM",
    "COMMANDS",
    "DENIED",
    "HERE",
    "MODE",
    "RISE",
    "SETPOINT",
    "STEP",
    "STILL",
    "THERE",
    "Answer",
    "Family",
    "ScriptedAutopilot",
    "SteppedClock",
    "Wire",
    "acknowledgement",
    "mode_number",
    "robot_of",
]

Family: TypeAlias = Literal["px4", "ardupilot"]
Message: TypeAlias = Any
"""One of pymavlink's, which has no types."""
Answer: TypeAlias = Callable[[Message], Iterable[Message]]

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
MODE = mavlink.MAV_CMD_DO_SET_MODE
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
RISE = mavlink.MAV_CMD_NAV_TAKEOFF
SETPOINT = "SET_POSITION_TARGET_LOCAL_NED"
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
STILL = VelocitySetpoint(np.zeros(3))
HERE: Peer = ("127.0.0.1", 14550)
"""Address of the scripted autopilot."""
THERE: Peer = ("10.0.0.2", 14550)
"""Another address."""
STEP = 0.05
_POSITION = {"px4": 3 << 16, "ardupilot": 5}
"""A pilot's mode, which keeps the position."""


def mode_number(family: Family, mode: FlightMode) -> int:
    """Custom mode of a HEARTBEAT; that of a pilot for FlightMode.OTHER."""
    if mode is FlightMode.OTHER:
        return _POSITION[family]
    if family == "ardupilot":
        return int(ArduPilot().ask_mode(mode).values[1])
    _, main, sub, *_ = PX4().ask_mode(mode).values
    return int(main) << 16 | int(sub) << 24


def acknowledgement(number: int, result: int = ACCEPTED, system: int = 245) -> Message:
    """A COMMAND_ACK to `system`."""
    return mavlink.MAVLink_command_ack_message(number, result, 0, 0, system, 191)


def robot_of(port: int, **settings: Any) -> RobotConfig:  # noqa: ANN401
    """A robot that waits for its vehicle at `port`; `limits` and the like go to the robot."""
    own = {
        name: settings.pop(name)
        for name in ("remote_id", "preflight", "actuators")
        if name in settings
    }
    return RobotConfig.model_validate(
        {
            "id": "drone",
            "driver": "mavlink",
            "limits": {"max_speed": 4.0, "cruise_speed": 2.0, **settings.pop("limits", {})},
            "start": settings.pop("start", (0, 0, 0)),
            **own,
            "settings": {"url": f"udpin:127.0.0.1:{port}", "ready_timeout": 15.0, **settings},
        }
    )


class SteppedClock:
    """Seconds that the test moves: each of `turns` is called with the time, `step` apart."""

    def __init__(self, step: float = STEP) -> None:
        self.now = 1000.0
        self.step = step
        self.turns: list[Callable[[float], object]] = []

    def advance(self, seconds: float) -> None:
        """Let time pass."""
        end = self.now + seconds - self.step / 2
        while self.now < end:
            self.now = round(self.now + self.step, 6)
            for turn in list(self.turns):
                turn(self.now)

    def drive(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Take the driver's own clocks and threads away: links turn, and waits end, by this one."""
        monotonic = SimpleNamespace(monotonic=lambda: self.now, sleep=self._sleep, time=time.time)
        brought = {kind.__module__.rpartition(".")[0] + "." for kind in added("mavlink_components")}
        for name, module in list(sys.modules.items()):
            if name.startswith(("aerodaas.drivers.mavlink.", *brought)) and hasattr(module, "time"):
                monkeypatch.setattr(module, "time", monotonic)
        clock = self

        class Inbox(queue.SimpleQueue):  # type: ignore[type-arg]
            """A queue whose waiting lets the clock pass."""

            def get(self, block: bool = True, timeout: float | None = 0.0) -> Message:  # noqa: FBT001, FBT002
                del block
                until = clock.now + (timeout or 0.0)
                while self.empty() and clock.now < until:
                    clock.advance(clock.step)
                return super().get_nowait()

        monkeypatch.setattr(link_module, "queue", SimpleNamespace(SimpleQueue=Inbox))
        monkeypatch.setattr(MavlinkLink, "_start", lambda link: self.turns.append(link.step))
        closing = MavlinkLink.close

        def close(link: MavlinkLink) -> None:
            self.turns = [turn for turn in self.turns if turn != link.step]
            closing(link)

        monkeypatch.setattr(MavlinkLink, "close", close)

    def _sleep(self, seconds: float) -> None:
        self.advance(max(seconds, self.step))


class Wire:
    """A `Transport` in memory: what arrived, and what was sent to whom."""

    def __init__(self, hear: Callable[[bytes], object] = lambda _: None) -> None:
        self.inbox: list[tuple[bytes, Peer]] = []
        self.sent: list[tuple[bytes, tuple[Peer, ...]]] = []
        self.closed = 0
        self._hear = hear

    def receive(self) -> list[tuple[bytes, Peer]]:
        """What has arrived since."""
        arrived, self.inbox = self.inbox, []
        return arrived

    def send(self, packet: bytes, peers: tuple[Peer, ...] = ()) -> None:
        """Record a packet."""
        self.sent.append((packet, peers))
        self._hear(packet)

    def close(self) -> None:
        """Count it."""
        self.closed += 1

    @staticmethod
    def fileno() -> int:
        """It is never waited for."""
        return -1


class ScriptedAutopilot:
    """An autopilot at 47 north, 8 east, that speaks 20 times a second and does nothing by itself.

    The script: `answers` gives the messages with which it answers a message (by its name) or a
    command (by its number), `silent` names those that it does not answer, and `result` is that of
    all other commands (None: no acknowledgement). Its attributes are what it says of itself next.
    It is met over a `wire`, or directly: `send`, `listen` and `target` are those of a MavlinkLink.
    """

    target = (1, 1)

    def __init__(
        self,
        family: Family = "px4",
        *,
        answers: dict[str | int, Answer] | None = None,
        silent: Iterable[str | int] = (),
        result: int | None = ACCEPTED,
        clock: SteppedClock | None = None,
    ) -> None:
        self.family: Family = family
        self.answers = dict(answers or {})
        self.silent = set(silent)
        self.result = result
        self.clock = clock or SteppedClock()
        self.received: list[tuple[float, Message]] = []
        """Each message with its second."""
        self.wire = Wire(self._on_packet)
        self.speaks = True
        self.armed = False
        self.mode = FlightMode.OTHER
        self.status = mavlink.MAV_STATE_ACTIVE
        self.position = np.array([10.0, 20.0, -3.0])
        """Metres north, east, down of its own zero; it first stands 488 m above the sea."""
        self.velocity = np.zeros(3)
        self.globe: tuple[int, int] = (470000000, 80000000)
        """Degrees of latitude and longitude times ten million; zeros: it does not know."""
        self.mute: set[str] = set()
        """Names of messages that it does not say."""
        self.landed = mavlink.MAV_LANDED_STATE_ON_GROUND
        self.checks_pass = True
        self._codec = mavlink.MAVLink(None, *self.target)
        self._ear = mavlink.MAVLink(None, 9, 9)
        self._said: deque[Message] = deque()
        self._listening = False

    def say(self, message: Message, peer: Peer = HERE, ids: tuple[int, int] | None = None) -> bytes:
        """Have it, or another system, say something; returns the packet."""
        if self._listening:
            self._said.append(message)
            return b""
        codec = self._codec if ids is None else mavlink.MAVLink(None, *ids)
        packet = bytes(message.pack(codec))
        codec.seq = (codec.seq + 1) % 256
        self.wire.inbox.append((packet, peer))
        return packet

    def _on_packet(self, packet: bytes) -> None:
        self.send(self._ear.decode(bytearray(packet)))

    def send(self, message: Message) -> None:
        """Receive one message, and answer it by the script."""
        self.received.append((round(self.clock.now, 3), message))
        kind = message.get_type()
        number = message.command if kind in COMMANDS else kind
        if number in self.silent or kind in self.silent:
            return
        answer = self.answers.get(number, self.answers.get(kind))
        if answer is not None:
            for said in answer(message):
                self.say(said)
        elif kind in COMMANDS and self.result is not None:
            self.say(acknowledgement(number, self.result))

    @contextlib.contextmanager
    def listen(self, *names: str) -> Iterator[SimpleNamespace]:
        """Queue of its answers of these names; waiting in vain moves the clock."""
        self._listening = True
        self._said.clear()

        def get(timeout: float) -> Message:
            while self._said:
                message = self._said.popleft()
                if message.get_type() in names:
                    self.clock.now += 0.01
                    return message
            self.clock.now += timeout
            raise queue.Empty

        yield SimpleNamespace(get=get)
        self._listening = False

    def speak(self, _: float = 0.0) -> None:
        """Say what it is and does, while it speaks."""
        if not self.speaks:
            return
        boot = round((self.clock.now - 900.0) * 1e3)
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        kind = 12 if self.family == "px4" else 3
        checks = mavlink.MAV_SYS_STATUS_PREARM_CHECK
        present, well = checks | 1, (checks if self.checks_pass else 0) | 1
        altitude = 485_000 - round(float(np.nan_to_num(self.position[2])) * 1e3)
        number = mode_number(self.family, self.mode)
        for message in (
            mavlink.MAVLink_heartbeat_message(2, kind, armed, number, self.status, 3),
            mavlink.MAVLink_sys_status_message(
                present, present, well, 100, 12000, 500, 50, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_extended_sys_state_message(0, self.landed),
            mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(boot, *self.position, *self.velocity),
            mavlink.MAVLink_global_position_int_message(boot, *self.globe, altitude, 0, 0, 0, 0, 0),
        ):
            if message.get_type() not in self.mute:
                self.say(message)

    def say_text(self, text: str, severity: int = 3) -> None:
        """Say a STATUSTEXT."""
        self.say(mavlink.MAVLink_statustext_message(severity, text.encode(), 0, 0))

    def start_anew(self) -> None:
        """Say that it boots."""
        kind = 12 if self.family == "px4" else 3
        self.say(mavlink.MAVLink_heartbeat_message(2, kind, 0, 0, mavlink.MAV_STATE_BOOT, 3))

    def of(self, *kinds: str) -> list[Message]:
        """Messages of these names that it received."""
        return [message for _, message in self.received if message.get_type() in kinds]

    def kinds(self) -> list[str]:
        """Names of what it received."""
        return [message.get_type() for _, message in self.received]

    def orders(self) -> list[int]:
        """Numbers of its commands, without those for messages."""
        messages = {mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE}
        return [one.command for one in self.of(*COMMANDS) if one.command not in messages]

    def modes(self) -> list[FlightMode]:
        """Modes that it was asked for."""
        driver = PX4() if self.family == "px4" else ArduPilot()
        asked = [one for one in self.of("COMMAND_LONG") if one.command == MODE]
        if self.family == "px4":
            return [driver.mode(int(one.param2) << 16 | int(one.param3) << 24) for one in asked]
        return [driver.mode(int(one.param2)) for one in asked]

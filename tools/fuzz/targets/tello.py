"""Replies and state packets of a Tello, in flight, into the whole driver and its mission."""

from __future__ import annotations

import random
import re
from collections import deque
from collections.abc import Iterable
from types import SimpleNamespace
from typing import Any

import numpy as np
from typing_extensions import Self

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.errors import VehicleError
from aerodaas.extensions.tello import link, vehicle
from aerodaas.extensions.tello.link import TelloLink
from aerodaas.extensions.tello.vehicle import TelloVehicle
from tools.fuzz.flight import (
    LIMITS,
    START,
    TURN,
    FuzzedFlight,
    ViolationError,
    clock_of,
    queues_of,
    replaced,
    require,
)
from tools.fuzz.records import EARLY, LONGEST_REST, QUIET, early, record, records

__all__ = ["mutate", "run", "seeds"]

_ROBOT = RobotConfig.model_validate(
    {"id": "t", "driver": "tello", "limits": LIMITS, "start": START}
)
_OWN = ("192.168.10.1", 8889)
_STICKS = re.compile(r"rc (-?\d{1,3}) (-?\d{1,3}) (-?\d{1,3}) (-?\d{1,3})")
_LONGEST_BODY = 2000
_REPLY, _STATE, _STRANGERS_REPLY, _STRANGERS_STATE = range(4)
_FULL = 100
"""Percent."""
_FIELDS = tuple("pitch roll yaw vgx vgy vgz templ temph tof h bat baro time".split())  # noqa: SIM905


class _Rig:
    """A Tello that rises at once and then says that it hovers; `now` is the clock."""

    def __init__(self, early: deque[tuple[int, int, bytes]]) -> None:
        self.now = 1000.0
        self.early = early
        self.quiet, self.height, self.motors = False, 0, 0.0
        self.flies = False
        self.commands: list[tuple[bytes, str, int]] = []
        self.states: list[tuple[bytes, str, int]] = []
        self.link: TelloLink | None = None
        self.vehicle = TelloVehicle(_ROBOT, EnvironmentConfig(robots=[_ROBOT]))
        self._turns = 0

    def open(self, place: str, *_: object, **__: object) -> _Socket:
        """As the system: one socket for commands, another one for states."""
        return _Socket(self, self.states if place.endswith("state") else self.commands)

    def obey(self, text: str) -> None:
        """Obey what leaves the host, which must be safe."""
        if text.startswith("rc "):
            sticks = _STICKS.fullmatch(text)
            if sticks is None:
                raise ViolationError("sticks that are no four numbers")
            require(all(abs(int(one)) <= _FULL for one in sticks.groups()), "sticks beyond 100 %")
            return
        require(text in {"command", "takeoff", "land", "sdk?"}, f"an unknown command: {text}")
        if text == "takeoff":
            self.flies, self.height = True, 100
        elif text == "land":
            self.flies, self.height = False, 0
        self.commands.append((b"20" if text == "sdk?" else b"ok", *_OWN))

    def hear_record(self, kind: int, body: bytes) -> None:
        """Let the driver hear a record."""
        self.quiet = bool(kind & QUIET)
        host, port = ("192.168.10.66", 8889) if kind & 2 else _OWN
        inbox = self.states if kind & 1 == _STATE else self.commands
        inbox.append((body, host, port))

    def advance(self, _: float = 0.0) -> None:
        """Let a turn's time pass at both ends."""
        self.now = round(self.now + TURN, 6)
        self._turns += 1
        self.motors += TURN * self.flies
        if self.early:
            kind, _, body = self.early.popleft()
            self.hear_record(kind, body)
        if not self.quiet and self._turns % 2:
            self.states.append((_state(h=self.height, time=int(self.motors)), *_OWN))
        if self.link is not None:
            self.link.step()


class _Socket:
    """One of the host's sockets."""

    def __init__(self, rig: _Rig, inbox: list[tuple[bytes, str, int]]) -> None:
        self._rig = rig
        self.inbox = inbox

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Stay open: nothing is held."""

    def sendto(self, content: bytes, peer: tuple[str, int]) -> None:
        """Send to the Tello, and to nobody else."""
        require(peer == _OWN, "told a stranger")
        self._rig.obey(content.decode("ascii"))


def _taken(source: _Socket) -> list[tuple[bytes, str, int]]:
    arrived = source.inbox[:]
    source.inbox.clear()
    return arrived


def run(data: bytes) -> None:
    """Fly, hear what `data` says before and in flight, and check every setpoint and command."""
    heard = list(records(data, _LONGEST_BODY))
    first = early(heard)
    later = heard[len(first) :]
    rig = _Rig(first)

    def begin(started: TelloLink) -> None:
        rig.link = started

    def guard(*_: object) -> Any:  # noqa: ANN401
        return SimpleNamespace(restart=lambda **_: None, close=lambda: None)

    clock = clock_of(rig, rig.advance)
    with replaced(
        *((module, "time", clock) for module in (link, vehicle)),
        (link, "queue", queues_of(rig)),
        (link, "bound_socket", rig.open),
        (link, "datagrams", _taken),
        (link, "DeadMan", guard),
        (TelloLink, "_start", begin),
    ):
        try:
            rig.vehicle.connect(3.0)
        except VehicleError:
            return
        try:
            _fly(rig, later, by_hand=bool(len(data) % 2))
        finally:
            rig.quiet = False
            rig.vehicle.close()


def _fly(rig: _Rig, heard: list[tuple[int, int, bytes]], *, by_hand: bool) -> None:
    flight = FuzzedFlight(rig.vehicle, _ROBOT)
    flight.fly(lambda: _turn(rig, flight), rig.hear_record, heard, climb=60, by_hand=by_hand)


def _turn(rig: _Rig, flight: FuzzedFlight) -> None:
    rig.advance()
    flight.turn()
    require(np.isfinite(rig.vehicle.read().odometry.position).all(), "a position that is no number")


def _state(**fields: object) -> bytes:
    known = {"templ": 60, "temph": 63, "tof": 10, "bat": 80, "baro": "100.5", **fields}
    return "".join(f"{name}:{known.get(name, 0)};" for name in _FIELDS).encode() + b"\r\n"


def seeds() -> Iterable[bytes]:
    """States and replies in flight, a stranger's, a silence, a fall, and a garbled packet."""
    yield record(_STATE, 3, _state(h=100, vgx=3, yaw=20)) + record(_REPLY, 3, b"error Motor stop")
    yield record(_STRANGERS_STATE, 3, _state(bat=1)) + record(_STRANGERS_REPLY, 3, b"ok")
    yield record(_STATE | QUIET, 38, _state(h=100)) + record(_STATE, 2, _state(h=90))
    yield record(_STATE, 1, _state(h=90, vgz=40)) + record(_STATE, 30, _state(h=0))
    yield record(_STATE, 5, b"pitch:0;roll:0;bat:1e9;\xff\xfe") + record(_REPLY, 1, b"\xff")
    yield record(_STATE, 2, _state(temph=90, bat=5)) + record(_REPLY, 2, b"ok")
    yield record(_REPLY | EARLY, 0, b"error") + record(_STATE | EARLY | QUIET, 0, _state(bat=9))


_VALUES = (
    "nan",
    "-inf",
    "1e309",
    "-1",
    "0",
    "101",
    "180",
    "300",
    "-300",
    "-10000",
    "1000",
    "",
    "٣",
)
_REPLIES = (b"ok", b"error", b"out of range", b"20", b"", b"ok\0", b"error Auto land", b"OK" * 700)


_SENT = (_STATE, _STATE, _STATE, _STRANGERS_STATE, _REPLY, _STRANGERS_REPLY)


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Insert packets of extreme values, drop records, change fields, waits and senders."""
    found = list(records(data, _LONGEST_BODY))
    for _ in range(rng.randint(1, 4)):
        index = rng.randrange(len(found)) if found else 0
        kind, rest, body = found[index] if found else (0, 0, b"")
        match rng.randrange(5) if found else 0:
            case 0 | 1:
                kind = rng.choice(_SENT) | kind & EARLY
                said = _values(rng) if kind & 1 == _STATE else rng.choice(_REPLIES)
                found.insert(index, (kind, rng.randrange(6), said))
            case 2:
                del found[index]
            case 3:
                kind = rng.choice((kind ^ EARLY, kind ^ QUIET, kind & ~3 | rng.randrange(4)))
                found[index] = (kind, rng.choice((rest, 0, LONGEST_REST - 1)), body)
            case _:
                place = rng.randrange(len(body) + 1)
                found[index] = (kind, rest, body[:place] + _value(rng) + body[place + 1 :])
    return b"".join(record(*one) for one in found[:30])


def _values(rng: random.Random) -> bytes:
    names = rng.sample(_FIELDS, rng.randint(1, 5))
    return _state(**{"h": 100, **{name: _value(rng).decode() for name in names}})


def _value(rng: random.Random) -> bytes:
    whole = str(rng.randint(-320, 320))
    return rng.choice((whole, rng.choice(_VALUES))).encode()

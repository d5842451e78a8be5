"""Bytes and messages of a MAVLink vehicle, in flight, into the whole driver and its mission."""

from __future__ import annotations

import math
import random
import struct
from collections import deque
from collections.abc import Iterable
from typing import Any

import numpy as np

from aerodaas.config.model import EnvironmentConfig, RobotConfig
from aerodaas.drivers.mavlink import connecting, vehicle
from aerodaas.drivers.mavlink.control import watchdog
from aerodaas.drivers.mavlink.microservices import parameters
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.drivers.mavlink.wire import link
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import ned_to_enu
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
    {
        "id": "d",
        "driver": "mavlink",
        "limits": LIMITS,
        "start": START,
        "settings": {"failsafes": "ignore", "ready_timeout": 2.0},
    }
)
_OWN, _STRANGER = ("127.0.0.1", 14550), ("127.0.0.1", 6666)
_GUIDED = 4
_VEHICLE = MavlinkVehicle(_ROBOT, EnvironmentConfig(robots=[_ROBOT]))
_KINDS = sorted(
    {
        *(mavlink.MAVLINK_MSG_ID_PARAM_VALUE, mavlink.MAVLINK_MSG_ID_MISSION_COUNT),
        mavlink.MAVLINK_MSG_ID_MISSION_ITEM_INT,
        *(link._MESSAGE_IDS[name] for name in _VEHICLE._telemetry.messages),  # noqa: SLF001
        *(link._MESSAGE_IDS[name] for name in _VEHICLE._handlers),  # noqa: SLF001
    }
)
"""Every message that the driver reads, those of its transfers included."""
_LONGEST_BODY = 600
_BYTES, _MESSAGE, _FORGED, _OTHER = range(4)
"""Bytes as they are; a message of the vehicle, of a stranger, of another system: kind, payload."""
_FIRST = 3
"""Turns in each of which the vehicle says everything, so that it is soon met."""
_WORD = 4
"""Bytes of most fields."""
_SILENT = 5.0
"""Seconds of silence after which a vehicle on the ground may have another address."""
_PARAMETERS = {
    "MAV_GCS_SYSID": 245,
    "MAV_GCS_SYSID_HI": 0,
    "FS_GCS_TIMEOUT": 3,
    "RTL_ALT_M": 3,
    "RTL_ALT_FINAL_M": 0,
    "FS_OPTIONS": 8,
    "FS_GCS_ENABLE": 1,
    "BATT_FS_LOW_ACT": 2,
    "FS_EKF_ACTION": 1,
}
"""Of the vehicle; it does not know others."""


class _Rig:
    """An ArduCopter that flies at once as it is told, with its driver; `now` is the clock."""

    def __init__(self, early: deque[tuple[int, int, bytes]]) -> None:
        self.now = 1000.0
        self.early = early
        self.connected = False
        self.armed, self.rising, self.quiet = False, 0, False
        self.mode = _GUIDED
        self._told: tuple[object, ...] = ()
        self.up = 0.0
        self.sent: list[Any] = []
        self._mav = mavlink.MAVLink(None, 1, 1)
        self._ear = mavlink.MAVLink(None, 9, 9)
        self._inbox: list[tuple[bytes, tuple[str, int]]] = []
        self.vehicle = MavlinkVehicle(_ROBOT, EnvironmentConfig(robots=[_ROBOT]))
        self.link: MavlinkLink | None = None
        self._turns = 0
        self._spoke_at, self._was_silent = math.inf, False

    def receive(self) -> list[tuple[bytes, tuple[str, int]]]:
        """As the wire."""
        arrived, self._inbox = self._inbox, []
        return arrived

    def send(self, packet: bytes, peers: tuple[object, ...]) -> None:
        """As the wire: obey, if it is for this vehicle alone."""
        require(not self.connected or peers == (_OWN,) or self._may_move(), "told a stranger")
        message = self._ear.decode(bytearray(packet))
        kind = message.get_type()
        if kind == "SET_POSITION_TARGET_LOCAL_NED":
            self.sent.append(message)
        elif kind in {"COMMAND_LONG", "COMMAND_INT"}:
            if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = message.param1 == 1
            elif message.command == mavlink.MAV_CMD_NAV_TAKEOFF:
                self.rising = 4
            elif message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = round(message.param2)
            elif message.command == mavlink.MAV_CMD_REQUEST_MESSAGE:
                self.hear(_version())
            self.hear(mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, 245, 191))
        elif kind == "PARAM_REQUEST_READ" and message.param_id in _PARAMETERS:
            self.hear(_parameter(message.param_id))

    def close(self) -> None:
        """As the wire."""

    def hear(self, message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
        """Let the driver hear a message of the vehicle."""
        self.arrive(bytes(message.pack(self._mav)), _OWN)

    def arrive(self, content: bytes, peer: tuple[str, int]) -> None:
        """Let the driver hear a datagram."""
        if peer == _OWN:
            self._was_silent, self._spoke_at = self._may_move(), self.now
        self._inbox.append((content, peer))

    def _may_move(self) -> bool:
        """Whether it was silent for so long that another address may be taken for its own."""
        return self._was_silent or self.now - self._spoke_at > _SILENT

    def hear_record(self, kind: int, body: bytes) -> None:
        """Let the driver hear a record."""
        self.quiet = bool(kind & QUIET)
        sender = kind & 3
        if sender == _BYTES:
            self.arrive(body, _OWN)
        elif body:
            number, system = _KINDS[body[0] % len(_KINDS)], 2 if sender == _OTHER else 1
            peer = _STRANGER if sender == _FORGED else _OWN
            self.arrive(_packet(number, body[1:], system), peer)

    def advance(self, _: float = 0.0) -> None:
        """Let a turn's time pass at both ends."""
        self.now = round(self.now + TURN, 6)
        self._turns += 1
        if self.early:
            kind, _, body = self.early.popleft()
            self.hear_record(kind, body)
        if not self.quiet:
            self._speak()
        if self.link is not None:
            self.link.step(self.now)

    def _speak(self) -> None:
        climb = 0.0
        if self.rising > 0 and self.armed:
            self.rising, climb = self.rising - 1, 6.0
            self.up += 0.3
        boot = round((self.now - 900.0) * 1e3)
        before, self._told = self._told, (self.mode, self.armed, self.up, climb)
        if self._told == before and self._turns > _FIRST and self._turns % 10:
            return
        armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
        for message in (
            mavlink.MAVLink_heartbeat_message(2, 3, armed, self.mode, 4, 3),
            mavlink.MAVLink_sys_status_message(1, 1, 1, 0, 12000, 500, 80, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_extended_sys_state_message(0, 2 if self.up > 0.0 else 1),
            mavlink.MAVLink_attitude_message(boot, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_local_position_ned_message(boot, 0, 0, -self.up, 0, 0, -climb),
            mavlink.MAVLink_global_position_int_message(
                boot, 470000000, 80000000, 488000 + round(1e3 * self.up), 0, 0, 0, 0, 0
            ),
        ):
            self.hear(message)


def run(data: bytes) -> None:
    """Fly, hear what `data` says before and in flight, and check every setpoint."""
    heard = list(records(data, _LONGEST_BODY))
    first = early(heard)
    later = heard[len(first) :]
    rig = _Rig(first)

    def begin(started: MavlinkLink) -> None:
        rig.link = started

    clock = clock_of(rig, rig.advance)
    with replaced(
        (vehicle, "time", clock),
        (connecting, "time", clock),
        (watchdog, "time", clock),
        (parameters, "time", clock),
        (link, "queue", queues_of(rig)),
        (link, "open_transport", lambda *_: rig),
        (MavlinkLink, "_start", begin),
    ):
        try:
            rig.vehicle.connect(1.0)
        except VehicleError:
            return
        try:
            require(not (rig.sent or rig.armed), "flown before the mission")
            _fly(rig, later, by_hand=bool(len(data) % 2))
        finally:
            rig.quiet = False
            rig.vehicle.close()


def _fly(rig: _Rig, heard: list[tuple[int, int, bytes]], *, by_hand: bool) -> None:
    assert rig.link is not None  # noqa: S101 - it is connected
    if rig.link.pins.pin.address != _OWN:
        return  # it was a stranger who was met first
    rig.connected = True
    flight = FuzzedFlight(rig.vehicle, _ROBOT)
    flight.fly(lambda: _turn(rig, flight), rig.hear_record, heard, climb=40, by_hand=by_hand)


def _turn(rig: _Rig, flight: FuzzedFlight) -> None:
    rig.advance()
    flight.turn()
    sent, rig.sent = rig.sent, []
    if not sent:
        return
    frame = rig.vehicle.connection.alignment.frame
    position = rig.vehicle.telemetry.position
    for message in sent:
        velocity = np.array([message.vx, message.vy, message.vz], np.float64)
        flight.check_motion(ned_to_enu(velocity), float(message.yaw_rate))
        place = np.array([message.x, message.y, message.z], np.float64)
        if not message.type_mask & mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE:
            if frame is None or position is None:
                raise ViolationError("a place without a position")
            flight.check_place(frame.position(place), frame.position(position))


def _packet(number: int, payload: bytes, system: int) -> bytes:
    """A packet that is whole, whatever its payload."""
    size = mavlink.mavlink_map[number].unpacker.size
    payload = payload[:size].ljust(size, b"\0")
    head = bytes([size, 0, 0, 0, system, 1, number & 255, number >> 8 & 255, number >> 16])
    crc = mavlink.x25crc(bytearray(head + payload + bytes([mavlink.mavlink_map[number].crc_extra])))
    return b"\xfd" + head + payload + struct.pack("<H", crc.crc)


def _version() -> Any:  # noqa: ANN401
    return mavlink.MAVLink_autopilot_version_message(
        0, 0x04050000, 0, 0, 0, *[bytes(8)] * 3, 0, 0, 7
    )


def _parameter(name: str) -> Any:  # noqa: ANN401
    value = float(_PARAMETERS[name])
    kind = mavlink.MAV_PARAM_TYPE_REAL32
    return mavlink.MAVLink_param_value_message(name.encode(), value, kind, len(_PARAMETERS), 0)


def _said(message: Any, kind: int = _MESSAGE, rest: int = 1) -> bytes:  # noqa: ANN401
    packed = message.pack(mavlink.MAVLink(None, 1, 1))
    number = _KINDS.index(message.get_msgId())
    return record(kind, rest, bytes([number]) + bytes(packed[10:-2]))


def seeds() -> Iterable[bytes]:
    """What a vehicle says in flight, a forged word, a silence, a restart, and plain bytes."""
    boot = 103_000
    here = mavlink.MAVLink_local_position_ned_message(boot, 0, 0, -1.2, 0, 0, 0)
    look = mavlink.MAVLink_attitude_message(boot, 0.1, 0.1, 1, 0, 0, 0)
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 128, _GUIDED, 4, 3)
    yield _said(here) + _said(look) + _said(beat)
    yield _said(mavlink.MAVLink_heartbeat_message(2, 3, 128, 6, 5, 3), rest=30)
    yield _said(mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 3, 3), _FORGED) + _said(here, _OTHER)
    yield _said(beat, _MESSAGE | QUIET, 38) + _said(here)
    yield _said(mavlink.MAVLink_attitude_message(5, 0, 0, 0, 0, 0, 0)) + _said(here, rest=20)
    yield _said(mavlink.MAVLink_statustext_message(2, b"PreArm: \xff\xfe", 3, 1)) + _said(
        mavlink.MAVLink_gps_raw_int_message(0, 3, 1, 2, 3, 4, 5, 6, 7, 8)
    )
    yield _said(mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 20)) + _said(
        mavlink.MAVLink_ekf_status_report_message(831, 0, 0, 0, 0, 0)
    )
    yield _said(_parameter("FS_OPTIONS"), _MESSAGE | EARLY) + _said(_version(), _MESSAGE | EARLY)
    yield _said(here, _MESSAGE | EARLY | QUIET) + _said(beat, _FORGED | EARLY) + _said(look)
    yield record(_BYTES, 1, bytes(beat.pack(mavlink.MAVLink(None, 1, 1))) + b"\xfd\x00\xfenoise")


_PATTERNS = (
    *(struct.pack("<f", value) for value in (float("nan"), float("inf"), -1e38, 1e6, 5.0, -5.0)),
    *(
        b"\xff" * 4,
        b"\x7f\xff\xff\xff",
        b"\xff\xff\xff\x7f",
        b"\x80\0\0\0",
        b"\0\0\0\x80",
        bytes(4),
    ),
)


_SENT = (_MESSAGE, _MESSAGE, _MESSAGE, _FORGED, _OTHER)


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Insert messages of extreme values, drop records, change fields, waits and senders."""
    found = list(records(data, _LONGEST_BODY))
    for _ in range(rng.randint(1, 4)):
        index = rng.randrange(len(found)) if found else 0
        kind, rest, body = found[index] if found else (0, 0, b"")
        match rng.randrange(6) if found else 0:
            case 0 | 1:
                kind = rng.choice(_SENT) | kind & EARLY
                found.insert(index, (kind, rng.randrange(8), _body(rng)))
            case 2:
                del found[index]
            case 3:
                kind = rng.choice((kind ^ EARLY, kind ^ QUIET, kind & ~3 | rng.randrange(4)))
                found[index] = (kind, rng.choice((rest, 0, LONGEST_REST - 1)), body)
            case _:
                place = rng.randrange(1, max(2, len(body) - _WORD + 1))
                found[index] = (kind, rest, body[:place] + _value(rng) + body[place + _WORD :])
    return b"".join(record(*one) for one in found[:30])


def _body(rng: random.Random) -> bytes:
    number = rng.randrange(len(_KINDS))
    size = mavlink.mavlink_map[_KINDS[number]].unpacker.size
    return bytes([number]) + b"".join(_value(rng) for _ in range(size // _WORD + 1))


def _value(rng: random.Random) -> bytes:
    match rng.randrange(4):
        case 0:
            return rng.randbytes(_WORD)
        case 1:
            return struct.pack("<f", rng.uniform(-10.0, 10.0))
        case _:
            return rng.choice(_PATTERNS)

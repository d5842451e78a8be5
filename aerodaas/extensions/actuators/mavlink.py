"""Grippers, servos, relays and parachutes by MAVLink's commands, one after the other.

An acknowledgement says that the autopilot has taken a command. Of servos and relays it also tells
what it puts out (SERVO_OUTPUT_RAW, RELAY_STATUS): it is asked for that, and its word counts for
more. A gripper and a parachute are taken at their acknowledgement.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace

from aerodaas.config.sections.actuators import (
    ActuatorConfig,
    GripperConfig,
    ParachuteConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.drivers.mavlink.component import ComponentContext, MavlinkComponent, MessageHandler
from aerodaas.drivers.mavlink.connecting import Connection
from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import Message
from aerodaas.errors import VehicleError
from aerodaas.extensions.actuators.equipment import MoveResult
from aerodaas.messages.vehicle import VehicleState

__all__ = ["MavlinkActuators"]

_MOST = 16
"""Commands that wait for those before them."""
_ASKED = 0.5
"""Seconds between two requests for what is put out."""
_REQUESTS = 4
"""Requests, after which the acknowledgement alone counts."""
_TOLERANCE = 5
"""Microseconds within which a servo's output is the one that was asked for."""
_FIRST_PORT = 16
"""Servos of a SERVO_OUTPUT_RAW."""
_RELEASED = "released"
_APART = 0.5
"""Seconds from an acknowledgement to the next command of the same number, and one more for each
repetition: PX4 acknowledges twice, and each repetition is acknowledged; a late word must not be
taken for the next command's."""


@dataclass(slots=True)
class _Move:
    number: int
    actuator: ActuatorConfig
    position: str
    acknowledged: bool = False
    requests: int = 0
    due: float = 0.0


class MavlinkActuators(MavlinkComponent):
    """The actuators of one vehicle; implements `Actuators`."""

    def __init__(self, context: ComponentContext) -> None:
        """Carry those of the robot; with settings that only observe, none is moved."""
        super().__init__(context)
        self._known = {one.id: one for one in context.robot.actuators}
        self._lock = context.lock
        self._observes = context.settings.observe
        self._commander: Commander | None = None
        self._waiting: deque[_Move] = deque()
        self._current: _Move | None = None
        self._results: deque[MoveResult] = deque(maxlen=4 * _MOST)
        self._positions: dict[str, str] = {}
        self._asked = 0
        self._free_at: dict[int, float] = {}
        """When the next command of a number may be sent."""

    @property
    def handlers(self) -> Mapping[str, MessageHandler]:
        """Handlers of the messages that tell what the autopilot puts out."""
        return dict.fromkeys(("SERVO_OUTPUT_RAW", "RELAY_STATUS"), self._on_output)

    def connect(self, connection: Connection) -> None:
        """Command the vehicle from now on."""
        super().connect(connection)
        self._commander = connection.commander

    def complete(self, state: VehicleState, now: float, placed_at: float) -> VehicleState:
        """Add the positions that the vehicle has acknowledged."""
        del now, placed_at
        return replace(state, actuators=dict(self._positions)) if self._positions else state

    def move(self, actuator: str, position: str) -> int:
        """See `Actuators`.

        Args:
            actuator: Id of the actuator.
            position: Name of its position.
        """
        if position not in self._known[actuator].positions:
            raise VehicleError(f"{actuator} has no position {position!r}")
        return self._ask(actuator, position)

    def release_parachute(self, actuator: str) -> int:
        """See `Actuators`."""
        known = self._known[actuator]
        if not (isinstance(known, ParachuteConfig) and known.may_release):
            raise VehicleError(f"{actuator} is no parachute that may be fired")
        return self._ask(actuator, _RELEASED)

    def _ask(self, actuator: str, position: str) -> int:
        with self._lock:
            if self._observes:
                raise VehicleError(
                    'actuators stay as they are: with "observe" it is only looked at'
                )
            if self._commander is None:
                raise VehicleError("it is not connected")
            if len(self._waiting) >= _MOST:
                raise VehicleError(f"{_MOST} commands to its actuators wait already")
            self._asked += 1
            self._waiting.append(_Move(self._asked, self._known[actuator], position))
            self._next(self._commander)
            return self._asked

    def withdraw(self, number: int) -> None:
        """See `Actuators`."""
        with self._lock:
            self._waiting = deque(one for one in self._waiting if one.number != number)
            current, commander = self._current, self._commander
            if current is not None and current.number == number and commander is not None:
                self._current = None
                if not current.acknowledged:
                    command = _command(current).number
                    commander.withdraw(command)
                    self._free_at[command] = time.monotonic() + _APART
                self._next(commander)

    def results(self) -> list[MoveResult]:
        """See `Actuators`."""
        with self._lock:
            found = list(self._results)
            self._results.clear()
            return found

    def _next(self, commander: Commander) -> None:
        """Send the next command, if none is under way."""
        now = time.monotonic()
        if self._current is not None or not self._waiting:
            return
        command = _command(self._waiting[0])
        if now < self._free_at.get(command.number, now):
            return
        move = self._current = self._waiting.popleft()

        def done(outcome: CommandResult) -> None:
            apart = _APART + outcome.tries - 1
            self._free_at[command.number] = time.monotonic() + apart
            if self._current is not move:
                return
            if not outcome.accepted:
                self._end(move, outcome.text)
            elif _reported_by(move.actuator) is None:
                self._end(move)
            else:
                move.acknowledged = True

        commander.give(command, done, now=now)

    def _end(self, move: _Move, fault: str = "") -> None:
        self._current = None
        if not fault:
            self._positions[move.actuator.id] = move.position
        self._results.append(MoveResult(move.number, not fault, fault))
        if self._commander is not None:
            self._next(self._commander)

    def _on_output(self, message: Message, now: float) -> None:
        del now
        move = self._current
        if move is None or not move.acknowledged or not move.requests:
            return
        contradiction = _contradiction(message, move)
        if contradiction == "":
            self._end(move)
        elif contradiction is not None and move.requests >= _REQUESTS:
            self._end(move, f"acknowledged, and not done: {contradiction}")

    def step(self, now: float) -> None:
        """Ask what is put out."""
        commander = self._commander
        if commander is None:
            return
        self._next(commander)
        move = self._current
        if move is None or not move.acknowledged or now < move.due:
            return
        if commander.under_way(mavlink.MAV_CMD_REQUEST_MESSAGE) is not None:
            return
        if move.requests > _REQUESTS:
            self._end(move)
            return
        move.requests += 1
        move.due = now + _ASKED
        message = float(_reported_by(move.actuator) or 0)
        commander.give(
            PendingCommand(
                mavlink.MAV_CMD_REQUEST_MESSAGE,
                (message, *[0.0] * 6),
                "tell what it puts out",
                insists=False,
            ),
            now=now,
        )


def _command(move: _Move) -> PendingCommand:
    """The MAVLink command for a move; it may be repeated, for it names a state."""
    actuator, position = move.actuator, move.position
    what = f"{actuator.id}: {position}"
    if isinstance(actuator, GripperConfig):
        actions = {"release": mavlink.GRIPPER_ACTION_RELEASE, "grab": mavlink.GRIPPER_ACTION_GRAB}
        values = (float(actuator.instance), float(actions[position]))
        return _pending(mavlink.MAV_CMD_DO_GRIPPER, values, what)
    if isinstance(actuator, RelayConfig):
        values = (float(actuator.instance), float(position == "on"))
        return _pending(mavlink.MAV_CMD_DO_SET_RELAY, values, what)
    if isinstance(actuator, ServoConfig):
        values = (float(actuator.channel), float(actuator.positions[position]))
        return _pending(mavlink.MAV_CMD_DO_SET_SERVO, values, what)
    parachute = {
        "disable": mavlink.PARACHUTE_DISABLE,
        "enable": mavlink.PARACHUTE_ENABLE,
        _RELEASED: mavlink.PARACHUTE_RELEASE,
    }
    values = (float(parachute[position]), 0.0)
    return _pending(mavlink.MAV_CMD_DO_PARACHUTE, values, what)


def _pending(number: int, values: tuple[float, float], what: str) -> PendingCommand:
    return PendingCommand(number, (*values, *[0.0] * 5), what)


def _reported_by(actuator: ActuatorConfig) -> int | None:
    """Number of the message that tells what is put out for an actuator; None if none does."""
    if isinstance(actuator, ServoConfig):
        return int(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW)
    return int(mavlink.MAVLINK_MSG_ID_RELAY_STATUS) if isinstance(actuator, RelayConfig) else None


def _contradiction(message: Message, move: _Move) -> str | None:
    """How a message contradicts a move; empty if it confirms it, None if it says nothing of it."""
    actuator, kind = move.actuator, message.get_type()
    if isinstance(actuator, ServoConfig) and kind == "SERVO_OUTPUT_RAW":
        port, index = divmod(actuator.channel - 1, _FIRST_PORT)
        if message.port != port:
            return None
        found, wanted = (
            int(getattr(message, f"servo{index + 1}_raw")),
            actuator.positions[move.position],
        )
        same = abs(found - wanted) <= _TOLERANCE
        return "" if same else f"servo {actuator.channel} is at {found}, not {wanted} µs"
    if isinstance(actuator, RelayConfig) and kind == "RELAY_STATUS":
        bit = 1 << actuator.instance
        if not message.present & bit:
            return None
        on = bool(message.on & bit)
        return (
            "" if on == (move.position == "on") else f"relay {actuator.instance} is the other way"
        )
    return None

"""Commands and their acknowledgements: repeated when lost, never executed twice by mistake."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from aerodaas.drivers.mavlink.state.phase import FlightMode
from aerodaas.drivers.mavlink.wire.dialect import mavlink

__all__ = ["CommandResult", "Commander", "PendingCommand", "always"]

_TIMEOUT = 1.0
"""Seconds to wait for an acknowledgement."""
_PROGRESS = 5.0
"""The same after an acknowledgement IN_PROGRESS."""
_TRIES = 6
_LATER = 1.0
"""Seconds after which a temporarily rejected command is repeated, such as one to arm while
the estimator still settles."""
_STEERING = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_COMPONENT_ARM_DISARM,
        mavlink.MAV_CMD_NAV_TAKEOFF,
    }
)
"""Commands that would override who has taken the vehicle over while nothing was heard of it."""
_RESULTS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "rejected for now",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "not supported",
    mavlink.MAV_RESULT_FAILED: "failed",
}


@dataclass(frozen=True)
class PendingCommand:
    """One command to the autopilot.

    With a `frame` it goes as COMMAND_INT, where parameters 5 and 6 are degrees times 10^7.
    """

    number: int
    values: tuple[float, ...]
    """Parameters 1 to 7."""
    what: str
    """Description of the command, for messages."""
    frame: int | None = None
    mode: FlightMode | None = None
    """The commanded mode, if any."""
    insists: bool = True
    """Whether it is repeated after a temporary rejection."""


@dataclass(frozen=True)
class CommandResult:
    """Outcome of a command."""

    accepted: bool
    text: str = ""
    """Reason of a refusal, in a few words."""
    replaced: bool = False
    """Superseded by a newer command of the same number: neither executed nor refused."""
    tries: int = 1
    """Number of transmissions."""


def always() -> bool:
    """A command that may be repeated at any time."""
    return True


def _always_heard(_: float) -> bool:
    return True


@dataclass
class _Pending:
    order: PendingCommand
    done: Callable[[CommandResult], None]
    still: Callable[[], bool]
    tries: int = 0
    deadline: float = 0.0
    answer: str = "no answer"
    """Error text for giving up."""


class Commander:
    """Commander with one pending command per number; the link's thread calls `take` and `turn`."""

    def __init__(
        self,
        send: Callable[[Any], None],
        target: tuple[int, int],
        ours: int,
        in_touch: Callable[[float], bool] = _always_heard,
    ) -> None:
        """Send commands to one component.

        Args:
            send: Sends a message.
            target: System and component.
            ours: Our own system id.
            in_touch: Whether the vehicle's mode is known at a monotonic second. Commands of modes,
                motors and take-off wait until it is.
        """
        self.in_touch = in_touch
        self.stray = 0
        """Acknowledgements that were late, repeated, or for another sender."""
        self.answered = False
        """Whether a command was ever acknowledged, in whatever way."""
        self._send = send
        self._target = target
        self._ours = ours
        self._pending: dict[int, _Pending] = {}
        self._lock = threading.RLock()

    def give(
        self,
        order: PendingCommand,
        done: Callable[[CommandResult], None] = lambda _: None,
        *,
        still: Callable[[], bool] = always,
        now: float,
    ) -> None:
        """Send a command.

        It is repeated without an answer and after a temporary rejection. A newer command of the
        same number supersedes an older one, whose `done` gets that outcome.

        Args:
            order: The command.
            done: Called with its outcome, in the link's thread.
            still: Whether to repeat it: what the vehicle's state shows is done, acknowledged or
                not.
            now: Monotonic clock, seconds.
        """
        with self._lock:
            before = self._pending.get(order.number)
            self._pending[order.number] = pending = _Pending(order, done, still)
            if self._may_send(order, now):
                self._transmit(pending, now)
        if before is not None:
            before.done(
                CommandResult(accepted=False, text="replaced by a newer order", replaced=True)
            )

    def send(self, make: Callable[[int, int], Any]) -> None:
        """Send what `make` makes for the target's system and component; nothing answers it."""
        self._send(make(*self._target))

    @property
    def component(self) -> int:
        """Id of the component that is commanded."""
        return self._target[1]

    def to(self, component: int) -> Commander:
        """A commander of its own for another component of the same system."""
        return Commander(self._send, (self._target[0], component), self._ours)

    def withdraw(self, number: int) -> None:
        """Withdraw the command of this `number`; its `done` is not called."""
        with self._lock:
            self._pending.pop(number, None)

    def withdraw_steering(self) -> None:
        """Withdraw commands of modes, motors and take-off."""
        for number in _STEERING:
            self.withdraw(number)

    def _may_send(self, order: PendingCommand, now: float) -> bool:
        return order.number not in _STEERING or self.in_touch(now)

    def under_way(self, number: int) -> PendingCommand | None:
        """The unanswered command of this `number`; None without one."""
        with self._lock:
            pending = self._pending.get(number)
            return None if pending is None else pending.order

    def on_ack(self, message: Any, now: float) -> None:  # noqa: ANN401 - pymavlink has no types
        """Process a COMMAND_ACK.

        Args:
            message: The acknowledgement; one to other systems is ignored.
            now: Monotonic clock, seconds.
        """
        if message.target_system not in {0, self._ours}:
            return
        with self._lock:
            pending = self._pending.get(message.command)
            if pending is None:
                self.stray += 1
                return
            self.answered = True
            if message.result == mavlink.MAV_RESULT_IN_PROGRESS:
                pending.deadline = now + _PROGRESS
                return
            later = message.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
            if later and pending.order.insists:
                if pending.answer != _RESULTS[message.result]:
                    # PX4 sends it twice, and only the first counts.
                    pending.answer = _RESULTS[message.result]
                    pending.deadline = now + _LATER
                return
            del self._pending[message.command]
        if message.result == mavlink.MAV_RESULT_ACCEPTED:
            pending.done(CommandResult(accepted=True, tries=pending.tries))
        else:
            word = _RESULTS.get(message.result, f"result {message.result}")
            pending.done(CommandResult(accepted=False, text=word, tries=pending.tries))

    def step(self, now: float) -> None:
        """Repeat or give up unacknowledged commands; end those that telemetry shows to be done."""
        ended: list[tuple[_Pending, CommandResult]] = []
        with self._lock:
            for number, pending in list(self._pending.items()):
                if not pending.still():
                    del self._pending[number]
                    ended.append((pending, CommandResult(accepted=True, tries=pending.tries)))
                elif now < pending.deadline or not self._may_send(pending.order, now):
                    continue
                elif pending.tries >= _TRIES:
                    del self._pending[number]
                    outcome = CommandResult(
                        accepted=False, text=pending.answer, tries=pending.tries
                    )
                    ended.append((pending, outcome))
                else:
                    self._transmit(pending, now)
        for pending, outcome in ended:
            pending.done(outcome)

    def _transmit(self, pending: _Pending, now: float) -> None:
        order = pending.order
        p1, p2, p3, p4, p5, p6, p7 = order.values
        if order.frame is None:
            message = mavlink.MAVLink_command_long_message(
                *self._target, order.number, pending.tries, p1, p2, p3, p4, p5, p6, p7
            )
        else:
            message = mavlink.MAVLink_command_int_message(
                *self._target, order.frame, order.number, 0, 0, p1, p2, p3, p4, int(p5), int(p6), p7
            )
        pending.tries += 1
        pending.answer = "no answer"
        pending.deadline = now + _TIMEOUT
        self._send(message)

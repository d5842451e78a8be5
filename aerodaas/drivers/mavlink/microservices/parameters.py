"""Parameters of the autopilot: read, set, and checked for safety, by blocking calls."""

from __future__ import annotations

import queue
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot, Failsafe
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink, Message
from aerodaas.errors import VehicleError

__all__ = ["Parameters", "UnsafeParameter", "unsafe_parameters"]

_TIMEOUT = 0.7
_TRIES = 4
_LONGEST = 16
"""Letters of a parameter's name."""


@dataclass(frozen=True)
class _Value:
    value: float
    kind: int


class Parameters:
    """Parameters of one vehicle, by name; not for use in the link's thread."""

    def __init__(self, link: MavlinkLink, autopilot: Autopilot) -> None:
        self._link = link
        self._autopilot = autopilot

    def get(self, name: str) -> float | None:
        """Value of `name`; None if the vehicle has no such parameter, or does not answer."""
        return self.known([(name,)]).get(name)

    def known(self, wanted: Iterable[tuple[str, ...]], tries: int = _TRIES) -> dict[str, float]:
        """Values by name, asked for together.

        What the vehicle does not know, or does not tell, is missing. As many tries are made as for
        one.

        Args:
            wanted: Names of each parameter, of which the vehicle knows one.
            tries: How often to ask.
        """
        missing, found = set(wanted), dict[str, float]()
        with self._link.listen("PARAM_VALUE") as inbox:
            for _ in range(tries if missing else 0):
                for name in sorted(name for names in missing for name in names):
                    self._link.send(self._request(name))
                for name, told in self._told(inbox):
                    if answered := {names for names in missing if name in names}:
                        found[name] = told.value
                        missing -= answered
                    if not missing:
                        return found
        return found

    def set(self, name: str, value: float) -> None:
        """Set a parameter and verify it.

        Args:
            name: Name of the parameter.
            value: Its value, in the parameter's own unit.

        Raises:
            VehicleError: If it was not set.
        """
        before = self._read(name)
        if before is None:
            raise VehicleError(f"the autopilot knows no parameter {name}")
        if self._same(before, value):
            return
        encoded = self._autopilot.encode(value, before.kind)
        request = mavlink.MAVLink_param_set_message(
            *self._link.target, _bytes(name), encoded, before.kind
        )
        for answer in self._answers(name, request):
            if self._same(answer, value):
                return
        now = self._read(name)
        if now is None or not self._same(now, value):
            held = "nothing is known of it" if now is None else f"it is {now.value:g}"
            raise VehicleError(f"the autopilot did not set {name} to {value:g}: {held}")

    def _read(self, name: str) -> _Value | None:
        return next(self._answers(name, self._request(name)), None)

    def _request(self, name: str) -> object:
        return mavlink.MAVLink_param_request_read_message(*self._link.target, _bytes(name), -1)

    def _answers(self, name: str, request: object) -> Iterator[_Value]:
        """Values of `name` received after `request`, which is repeated until one arrives."""
        with self._link.listen("PARAM_VALUE") as inbox:
            for _ in range(_TRIES):
                self._link.send(request)
                yield from (value for told, value in self._told(inbox) if told == name)

    def _told(self, inbox: queue.SimpleQueue[Message]) -> Iterator[tuple[str, _Value]]:
        """Names and values that arrive within the time for one answer."""
        deadline = time.monotonic() + _TIMEOUT
        while (left := deadline - time.monotonic()) > 0.0:
            try:
                message = inbox.get(timeout=left)
            except queue.Empty:
                return
            kind = message.param_type
            yield message.param_id, _Value(self._autopilot.decode(message.param_value, kind), kind)

    @staticmethod
    def _same(one: _Value, value: float) -> bool:
        # They are single-precision on the autopilot.
        return abs(one.value - value) <= 1e-5 * max(1.0, abs(value))


def _bytes(name: str) -> bytes:
    encoded = name.encode("ascii", "replace")
    if len(encoded) > _LONGEST:
        raise VehicleError(f"no parameter's name is as long as {name!r}")
    return encoded


@dataclass(frozen=True)
class UnsafeParameter:
    """A parameter that leaves the vehicle unprotected."""

    failsafe: Failsafe
    value: float

    @property
    def text(self) -> str:
        """One sentence, with the value to be set."""
        failsafe = self.failsafe
        return (
            f"{failsafe.name} is {self.value:g}, so that {failsafe.why}; {failsafe.safe:g} is safer"
        )


def unsafe_parameters(parameters: Parameters, autopilot: Autopilot) -> list[UnsafeParameter]:
    """Failsafes that are off by the vehicle's parameters; each is read from the vehicle.

    Args:
        parameters: Parameters of the vehicle.
        autopilot: The autopilot's dialect of commands and parameters.
    """
    held = parameters.known((one.name,) for one in autopilot.failsafes)
    return [
        UnsafeParameter(one, held[one.name])
        for one in autopilot.failsafes
        if held.get(one.name) in one.unsafe
    ]

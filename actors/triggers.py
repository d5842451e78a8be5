"""Triggers: commands to robots or analyses, published when a result meets a condition."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from aerodaas.actors.streams import Publisher
from aerodaas.types.clock import host_time_ns
from aerodaas.types.status import Message

__all__ = ["TriggerSpec", "Triggers"]


@dataclass(frozen=True)
class TriggerSpec:
    """A command to publish on `stream` when a result satisfies `when` (None: always)."""

    stream: str
    command: Any
    when: Callable[[Any], bool] | None


class Triggers:
    """Triggers of one analysis, in the process that publishes its results."""

    def __init__(self, specs: Iterable[TriggerSpec], publisher: Callable[[str], Publisher]) -> None:
        """Open the streams of `specs` with `publisher`."""
        self._specs = tuple(specs)
        self._publishers = {one.stream: publisher(one.stream) for one in self._specs}

    def fire(
        self,
        result: Any,  # noqa: ANN401
        origin: Message[Any],
        stamp: int,
        complain: Callable[[Exception], None],
    ) -> None:
        """Publish the commands for a `result` of `origin`; `complain` gets errors of conditions."""
        for one in self._specs:
            try:
                wanted = one.when is None or one.when(result)
            except Exception as error:  # noqa: BLE001 - a user's condition may raise anything
                complain(error)
                continue
            if wanted:
                self._publishers[one.stream].derive(one.command, origin, host_time_ns(), stamp)

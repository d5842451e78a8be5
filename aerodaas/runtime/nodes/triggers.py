"""Triggers: commands to robots or analyses, published when a result meets a condition."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from aerodaas.clock import host_time_ns
from aerodaas.messages.envelope import Message
from aerodaas.runtime.node import Node

__all__ = ["TriggerSpec", "fire"]


@dataclass(frozen=True)
class TriggerSpec:
    """A command to publish on `stream` when a result satisfies `when` (None: always)."""

    stream: str
    command: Any
    when: Callable[[Any], bool] | None


def fire(
    node: Node,
    triggers: Sequence[TriggerSpec],
    result: Any,  # noqa: ANN401
    origin: Message[Any],
    stamp: int,
    on_error: Callable[[Exception], None],
) -> Iterator[Message[Any]]:
    """Yield the commands that a result leads to.

    Args:
        node: Node that publishes them.
        triggers: Triggers of the analysis.
        result: The result.
        origin: Message that the result was made from.
        stamp: Mission time of the result, nanoseconds.
        on_error: Called with what a condition raises.
    """
    for trigger in triggers:
        try:
            met = trigger.when is None or trigger.when(result)
        except Exception as error:  # noqa: BLE001 - a user's condition may raise anything
            on_error(error)
            continue
        if met:
            outlet = node.outlet(trigger.stream)
            yield outlet.derive(trigger.command, origin, host_time_ns(), stamp)

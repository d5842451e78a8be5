"""Sends measurements on a stream, as a node's executor would."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

from aerodaas.actors.streams import Publisher
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.runtime.node import Outlet

__all__ = ["child_variables", "send"]

_OUTLETS: WeakKeyDictionary[Publisher, Outlet] = WeakKeyDictionary()


def send(publisher: Publisher, item: Any, header: Header, captured: int) -> Message[Any]:  # noqa: ANN401
    """Number a measurement, publish it, and return what was sent."""
    outlet = _OUTLETS.setdefault(publisher, Outlet(publisher.stream))
    return publisher.publish(outlet.measure(item, header, captured))


def child_variables() -> dict[str, str]:
    """Variables of a child process that imports this module and the project."""
    here = Path(__file__).parent
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(here.parents[1]), str(here)])}

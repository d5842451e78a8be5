"""Offering of an environment that is ready to start to whoever builds it without flying it.

A guest's process and the compiler of mission documents run an application for its graph.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from aerodaas.types.errors import GraphError

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment

__all__ = ["offer", "offered", "the_only"]

_offered: ContextVar[list[Environment] | None] = ContextVar("offered", default=None)
"""Receiver of the environments that are ready; None where an application flies."""


@contextmanager
def offered() -> Iterator[list[Environment]]:
    """Have `start_mission()` offer its environment, into the list, instead of flying."""
    found: list[Environment] = []
    token = _offered.set(found)
    try:
        yield found
    finally:
        _offered.reset(token)


def offer(environment: Environment) -> bool:
    """Offer an environment that is ready; False if it is to fly."""
    found = _offered.get()
    if found is None:
        return False
    found.append(environment)
    return True


def the_only(found: list[Environment]) -> Environment:
    """The one environment that was started; raises GraphError for none, or several."""
    if not found:
        raise GraphError("it never called start_mission()")
    if any(one is not found[0] for one in found):
        raise GraphError("it started several environments; there can be one")
    return found[0]

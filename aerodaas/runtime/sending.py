"""What is sent to other processes by value: checks that an object can be, and says why not."""

from __future__ import annotations

import contextlib
import inspect
import types
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import cloudpickle

from aerodaas.dataflow.graph import Graph
from aerodaas.errors import GraphError

__all__ = ["culprit", "require_sendable"]

_DEEPEST = 6
_MOST = 1000
"""Most elements of one container that are examined."""


def culprit(item: object, error: Exception) -> str:
    """Describe which part of `item` cannot be sent, and why.

    Args:
        item: What is to be sent.
        error: Error of the whole.

    >>> import threading
    >>> culprit({"lock": threading.Lock()}, TypeError("cannot pickle '_thread.lock' object"))
    "a dict cannot be sent: its item 'lock', a lock: cannot pickle '_thread.lock' object"
    """
    path, reason = _search(item, error, 0)
    place = f"{path}: " if path else ""
    return f"{_called(item)} cannot be sent: {place}{' '.join(str(reason).split())}"


def require_sendable(graph: Graph, *plugins: object) -> None:
    """Refuse a graph with an object that must be sent but cannot be pickled.

    Args:
        graph: The application's graph.
        plugins: Objects outside the graph that are sent, too, such as schedulers.

    Raises:
        GraphError: With the object's name and the part that cannot be pickled.
    """
    for node in graph.nodes.values():
        for trigger in node.triggers:
            _require(trigger.when, f"the condition of {node.id}'s trigger")
        if node.kind != "sensor":
            _require(node.work, f"{type(node.work).__name__} ({node.id})")
    for plugin in plugins:
        _require(plugin, type(plugin).__name__)


def _require(item: object, name: str) -> None:
    try:
        cloudpickle.dumps(item, protocol=5)
    except Exception as error:
        raise GraphError(
            f"{name} runs in a process of its own: {culprit(item, error)}; "
            "make in open() what cannot travel"
        ) from error


def _search(item: object, error: Exception, depth: int) -> tuple[str, Exception]:
    """Path to the innermost part that fails, and its error."""
    if depth < _DEEPEST:
        for name, part in _parts(item):
            reason = _failure(part)
            if reason is not None:
                path, innermost = _search(part, reason, depth + 1)
                return path or f"its {name}, a {type(part).__name__}", innermost
    return "", error


def _failure(part: object) -> Exception | None:
    try:
        cloudpickle.dumps(part)
    except Exception as error:  # noqa: BLE001 - a user's class may raise anything
        return error
    return None


def _called(item: object) -> str:
    name = type(item).__name__
    return f"a {name}" if type(item).__module__ == "builtins" else name


def _parts(item: object) -> Iterator[tuple[str, object]]:
    if isinstance(item, Mapping):
        yield from ((f"item {key!r}", part) for key, part in list(item.items())[:_MOST])
    elif isinstance(item, list | tuple | set | frozenset):
        yield from ((f"element {n}", part) for n, part in enumerate(list(item)[:_MOST]))
    yield from ((f"attribute {name!r}", part) for name, part in _attributes(item))
    yield from _globals_used(item if isinstance(item, types.FunctionType) else type(item))


def _attributes(item: object) -> Iterator[tuple[str, object]]:
    state = None if isinstance(item, type) else _state(item)
    yield from state.items() if isinstance(state, dict) else ()
    for one in inspect.getmro(type(item)):
        slots = one.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name not in {"__dict__", "__weakref__"} and hasattr(item, name):
                yield name, getattr(item, name)


def _state(item: object) -> object:
    """Pickled state of an object: its attributes, unless its class defines another."""
    told = getattr(item, "__getstate__", None)
    if callable(told):
        with contextlib.suppress(Exception):
            state = told()
            return state[0] if isinstance(state, tuple) and state else state
    return getattr(item, "__dict__", None)


def _globals_used(of: type | Callable[..., Any]) -> Iterator[tuple[str, object]]:
    """Globals of `__main__` used by a function or a class' methods, which are pickled with it."""
    for function in vars(of).values() if isinstance(of, type) else (of,):
        if isinstance(function, types.FunctionType) and function.__module__ == "__main__":
            for name in function.__code__.co_names:
                if name in function.__globals__:
                    where = f"global {name!r} (used by {function.__qualname__})"
                    yield where, function.__globals__[name]

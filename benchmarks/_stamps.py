"""Stamps at the steps of the data path, in whichever process installs them.

The steps are wrapped from outside, so that the path itself carries no code for it. Each process
writes its stamps to a file of the folder in `FOLDER` when it is told to.
"""

from __future__ import annotations

import functools
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from aerodaas.actors.streams import codec, local_publisher, local_subscriber, subscriber
from aerodaas.runtime.nodes.analysis import AnalysisNode
from aerodaas.runtime.nodes.controller import VehicleController

__all__ = ["FOLDER", "dump", "install"]

FOLDER = "AERODAAS_STAMPS"
"""Environment variable with the folder of the stamps; unset: none are taken."""
_stamps: list[tuple[str, str, int, int]] = []
"""Step, stream, number of the message in it, monotonic nanoseconds."""
_MOST = 200_000
_latest: dict[str, int] = {}


def _note(step: str, message: Any) -> None:  # noqa: ANN401 - a message
    if len(_stamps) < _MOST:
        _stamps.append((step, message.stream, message.seq, time.monotonic_ns()))


def _wrap(owner: Any, name: str, wrapper: Callable[..., Any]) -> None:  # noqa: ANN401
    original = getattr(owner, name)

    @functools.wraps(original)
    def wrapped(*arguments: Any, **keywords: Any) -> Any:  # noqa: ANN401
        return wrapper(original, *arguments, **keywords)

    setattr(owner, name, wrapped)


def _encode(original: Any, self: Any, message: Any) -> None:  # noqa: ANN401
    _note("encode", message)
    original(self, message)
    self.traced = message
    _note("encoded", message)


def _write(original: Any, self: Any, *target: Any) -> Any:  # noqa: ANN401
    _note("taken", self.traced)
    written = original(self, *target)
    _note("written", self.traced)
    return written


def _send(original: Any, self: Any, encode: Any) -> None:  # noqa: ANN401
    original(self, encode)
    _note("sent", encode.__self__.message)


def _ready(original: Any, self: Any, until: float) -> Any:  # noqa: ANN401
    ready = original(self, until)
    if until:
        _latest["awake"] = time.monotonic_ns()
    return ready


def _decode(original: Any, source: Any) -> Any:  # noqa: ANN401
    began = time.monotonic_ns()
    message = original(source)
    _stamps.append(("awake", message.stream, message.seq, _latest["awake"]))
    _stamps.append(("decode", message.stream, message.seq, began))
    _note("decoded", message)
    return message


def _work(original: Any, self: Any, message: Any) -> None:  # noqa: ANN401
    _note("work", message)
    original(self, message)


def _receive(original: Any, self: Any, message: Any, now: int) -> None:  # noqa: ANN401
    if message.stream in self.spec.navigation:
        _note("work", message)
    original(self, message, now)


def install() -> None:
    """Take stamps in this process from now on, if `FOLDER` is set; once."""
    if FOLDER not in os.environ or _latest:
        return
    _latest["awake"] = 0
    _wrap(codec.Encoded, "__init__", _encode)
    _wrap(codec.Encoded, "write_into", _write)
    _wrap(codec.Encoded, "to_bytes", _write)
    _wrap(local_publisher.LocalPublisher, "send", _send)
    _wrap(local_subscriber.LocalSubscriber, "_ready", _ready)
    _wrap(subscriber, "decode", _decode)
    _wrap(AnalysisNode, "_process_input", _work)
    _wrap(VehicleController, "receive", _receive)


def dump() -> None:
    """Write the stamps of this process to its file."""
    if FOLDER in os.environ:
        path = Path(os.environ[FOLDER]) / f"{os.getpid()}.stamps"
        path.write_text(json.dumps(_stamps), encoding="utf-8")

"""A target that fails in every way, by its first byte."""

from __future__ import annotations

import ctypes
import os
import sys
import threading
import time
from collections.abc import Iterable

__all__ = ["run", "seeds"]


def seeds() -> Iterable[bytes]:
    """One that does nothing."""
    return [b"-harmless"]


def run(data: bytes) -> None:
    """Fail as the input says."""
    _WAYS.get(data[:1], _nothing)(data)


def _nothing(data: bytes) -> None:
    assert isinstance(data, bytes)


def _raise(data: bytes) -> None:
    if b"!" in data:
        raise KeyError("raised")


def _deeper(data: bytes) -> None:
    _deeper(data)


def _loop(_: bytes) -> None:
    while True:
        try:
            time.sleep(0)
        except BaseException:  # noqa: BLE001, S112, PERF203 - the worst that a target may do
            continue


def _block(_: bytes) -> None:
    threading.Event().wait()


def _stuck(_: bytes) -> None:
    lock = ctypes.PyDLL(None).usleep
    while True:
        lock(10**9)


def _allocate(_: bytes) -> None:
    kept = []
    while True:
        kept.append(bytearray(2**22))


def _segfault(_: bytes) -> None:
    ctypes.string_at(1)


def _abort(_: bytes) -> None:
    os.abort()


def _leave(_: bytes) -> None:
    sys.exit(3)


def _thread(_: bytes) -> None:
    thread = threading.Thread(target=_deeper, args=(b"",))
    thread.start()
    thread.join()


_WAYS = {
    b"r": _raise,
    b"d": _deeper,
    b"l": _loop,
    b"b": _block,
    b"n": _stuck,
    b"m": _allocate,
    b"s": _segfault,
    b"a": _abort,
    b"x": _leave,
    b"t": _thread,
}

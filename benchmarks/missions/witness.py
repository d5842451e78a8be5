"""What an emulated vehicle truly did in the simulated world, to hold against criteria."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from aerodaas.messages.odometry import Odometry

__all__ = ["Witness"]

_PERIOD = 0.05


class Witness:
    """Writes down a vehicle's true motion, while it is used as a context."""

    def __init__(self, truth: Callable[[], Odometry], clock: Callable[[], float | None]) -> None:
        """Watch `truth` from when `clock` tells the world's seconds, not None."""
        self._truth = truth
        self._clock = clock
        self._rows: list[tuple[float, ...]] = []
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="witness", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._thread.join()

    @property
    def table(self) -> NDArray[np.float64]:
        """The world's seconds, true position and velocity (ENU, metres and m/s), shape (N, 7)."""
        return np.array(self._rows, np.float64).reshape(-1, 7)

    def _watch(self) -> None:
        while not self._leaving.wait(_PERIOD):
            seconds = self._clock()
            if seconds is not None:
                truth = self._truth()
                self._rows.append((seconds, *truth.position, *truth.velocity))

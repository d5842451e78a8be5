"""What an emulated Tello truly did in the world that it filmed, to hold against criteria."""

from __future__ import annotations

import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from typing_extensions import Self

from aerodaas.testing.tello import EmulatedTello

sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))

from missions.evidence import Evidence

__all__ = ["Witness"]

_PERIOD = 0.05


class Witness:
    """Writes down the emulated Tello's true motion, while it is used as a context."""

    def __init__(self, tello: EmulatedTello) -> None:
        """Watch `tello`."""
        self._tello = tello
        self._rows: list[tuple[float, ...]] = []
        self._film_began = 0.0
        self._leaving = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._leaving.set()
        self._thread.join()

    def evidence(self, recording: Path) -> Evidence:
        """The flight that was recorded, with the truth that was seen, by the film's own time."""
        believed = Evidence.read(recording)
        risen = next(stamp for stamp, text in self._tello.heard if text == "takeoff")
        late = risen - self._film_began - believed.bands("taking_off")[0].start
        robot, flight = believed.robot, believed.flight
        robot.bands = [
            replace(band, start=band.start + late, end=band.end + late) for band in robot.bands
        ]
        flight.alerts = [(time + late, name, text) for time, name, text in flight.alerts]
        table = np.array(self._rows)
        return replace(believed, time=table[:, 0], position=table[:, 1:4], velocity=table[:, 4:7])

    def _watch(self) -> None:
        while not self._leaving.wait(_PERIOD):
            self._film_began = self._tello.film_began or self._film_began
            if self._film_began:
                truth, seconds = self._tello.truth, time.monotonic() - self._film_began
                self._rows.append((seconds, *truth.position, *truth.velocity))

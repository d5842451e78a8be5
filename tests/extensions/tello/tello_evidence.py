"""What an emulated Tello truly did in the world that it filmed, to hold against criteria."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

from tools.tello_vehicle import EmulatedTello

sys.path.append(str(Path(__file__).parents[3] / "benchmarks"))

from missions.evidence import Evidence
from missions.witness import Witness

__all__ = ["TelloWitness"]


class TelloWitness(Witness):
    """Writes down the emulated Tello's true motion by the film's own time."""

    def __init__(self, tello: EmulatedTello) -> None:
        """Watch `tello`."""
        super().__init__(lambda: tello.truth, self._seconds)
        self._tello = tello
        self._film_began = 0.0

    def _seconds(self) -> float | None:
        self._film_began = self._tello.film_began or self._film_began
        return time.monotonic() - self._film_began if self._film_began else None

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
        table = self.table
        return replace(believed, time=table[:, 0], position=table[:, 1:4], velocity=table[:, 4:7])

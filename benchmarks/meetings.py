"""How near a follower comes to people who come at it, in the simulated world.

python benchmarks/meetings.py --speeds 1.3 --seeds 100 --first-seed 0
"""

from __future__ import annotations

import enum
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report

from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.types.errors import AeroDaaSError
from tools.tuning.chase import TELLO, Chase
from tools.tuning.meetings import CONTACT, Nearest, returning
from tools.tuning.perception import DetectorPerception, TruthPerception
from tools.tuning.walk import PERSON

KEPT = 0.5
"""Metres that the drone must keep from a walker."""
AFTER = 8.0
"""Metres that the walker comes back, and at most as many seconds."""
UNITS = {
    "flights": "",
    "turned at": "m, median",
    "nearest": "m, least",
    "5 %": "m",
    "median": "m",
    f"below {KEPT} m": "flights",
    "contact": "flights",
    "told": "flights",
}


class Sight(str, enum.Enum):
    """What the follower sees by."""

    TRUTH = "truth"
    MODEL = "model"


class Case(str, enum.Enum):
    """What happens."""

    CLOSE = "close"
    FAR = "far"


@dataclass(frozen=True)
class Flight:
    """One meeting."""

    case: Case
    eyes: Sight
    speed: float
    rate: float
    latency: float
    seed: int

    def fly(self) -> tuple[float, float, bool]:
        """Distance at the turn and least distance in metres; whether an alert told of it."""
        world, turn = returning(self.speed, self.seed, close=self.case is Case.CLOSE)
        person = world.thing(PERSON)
        near = Nearest([person])
        chase = Chase(person, "vest", self.rate, self.latency, seed=self.seed)
        duration = turn + min(AFTER, AFTER / self.speed)
        if self.eyes is Sight.TRUTH:
            sight = TruthPerception(person, "vest", TELLO, seed=self.seed)
            flown = chase.fly(VipFollowAnalytics(), sight, duration, monitor=near)
        else:
            detector = DetectorPerception(world, TELLO, VipDetectionAnalytics(threads=1))
            flown = chase.fly(VipFollowAnalytics(), detector, duration, monitor=near)
            detector.close()
        turned = near.before[min(near.before, key=lambda time: abs(time - turn))]
        return turned, near.least, "person_close" in flown.alerts


def main(
    case: Annotated[
        Case, typer.Option(help="They turn round while followed, or come from 8 m off.")
    ] = Case.CLOSE,
    eyes: Annotated[
        Sight,
        typer.Option(help="True boxes with 2 % noise and 3 % misses, or the detector on renders."),
    ] = Sight.TRUTH,
    speeds: Annotated[str, typer.Option(help="Of the person, m/s.")] = "0.3,0.7,1.0,1.3,1.8",
    rates: Annotated[str, typer.Option(help="Frames a second.")] = "10,5",
    seeds: Annotated[int, typer.Option(help="Flights for each speed and rate.", min=1)] = 10,
    first_seed: Annotated[int, typer.Option(help="The first seed.", min=0)] = 0,
    latency: Annotated[float, typer.Option(help="Seconds from capture to command.")] = 0.25,
    processes: Annotated[int, typer.Option(help="Flights at a time.", min=1)] = 2,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Have walkers turn round within a step and come back at the drone.

    Aims: never nearer than 0.5 m to who walks at 0.3 to 1.3 m/s, no contact with who walks at 1.8.
    """
    report = Report("meetings", UNITS, packages=["onnxruntime"])
    numbers = range(first_seed, first_seed + seeds)
    try:
        with ProcessPoolExecutor(processes) as pool:
            for speed, rate in product(speeds.split(","), rates.split(",")):
                flights = [
                    Flight(case, eyes, float(speed), float(rate), latency, seed) for seed in numbers
                ]
                found = list(pool.map(Flight.fly, flights))
                report.row(f"{speed} m/s, {rate} Hz", _figures(found))
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    report.note(
        f"{case.value}, {eyes.value} eyes, {seeds} seed(s) from {first_seed}, {latency:g} s from "
        f"capture to command; contact is below {CONTACT} m from the person's axis."
    )
    report.show()
    if json is not None:
        report.write(json)


def _figures(found: list[tuple[float, float, bool]]) -> dict[str, float]:
    turned, least, told = np.array(found).T
    return {
        "flights": float(len(found)),
        "turned at": float(np.median(turned)),
        "nearest": float(least.min()),
        "5 %": float(np.quantile(least, 0.05)),
        "median": float(np.median(least)),
        f"below {KEPT} m": float((least < KEPT).sum()),
        "contact": float((least < CONTACT).sum()),
        "told": float(told.sum()),
    }


if __name__ == "__main__":
    typer.run(main)

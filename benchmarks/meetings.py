"""How near a follower comes to people who come at it, with its guard against contact and without.

python benchmarks/meetings.py --speeds 1.3 --seeds 100 --first-seed 0
python benchmarks/meetings.py --speeds 1.3 --seeds 1 --picture meeting.png
"""

from __future__ import annotations

import enum
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report

from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.errors import AeroDaaSError
from tools.tuning.chase import TELLO, Chase, ChaseResult
from tools.tuning.meeting_plot import plot_meeting
from tools.tuning.meetings import CONTACT, STRANGER, Nearest, NoGuard, returning, stranger
from tools.tuning.perception import DetectorPerception, TruthPerception
from tools.tuning.walk import PERSON

KEPT = 0.5
"""Metres that the drone must keep from a walker."""
LONGEST = 8.0
"""Seconds, and metres, for which a walker comes back."""
STRANGER_PASSES = 3.0
"""Seconds for which the drone is watched after a stranger has been where it would be."""
UNITS = {
    "flights": "",
    "before": "m, median",
    "nearest": "m, least",
    "5 %": "m",
    "median": "m",
    f"below {KEPT} m": "flights",
    "contact": "flights",
    "told": "flights",
    "out of view": "s, median",
}


class Sight(str, enum.Enum):
    """What the follower sees by."""

    TRUTH = "truth"
    MODEL = "model"


class Case(str, enum.Enum):
    """Who comes."""

    RETURNS = "returns"
    STRANGER = "stranger"


@dataclass(frozen=True)
class Meeting:
    """One flight's figures, and its path."""

    before: float
    """Distance at the turn, metres."""
    least: float
    """Least distance, metres."""
    told: bool
    """Whether an alert told of somebody who comes."""
    unseen: float
    """Seconds from the turn on in which the followed person was out of view."""
    turn: float
    path: list[tuple[float, ...]]


@dataclass(frozen=True)
class Flight:
    """One meeting to be flown."""

    case: Case
    eyes: Sight
    speed: float
    rate: float
    latency: float
    seed: int
    guarded: bool

    def fly(self) -> Meeting:
        """Fly it."""
        build = returning if self.case is Case.RETURNS else stranger
        world, turn = build(self.speed, self.seed)
        person = world.thing(PERSON)
        others = [world.thing(STRANGER)] if self.case is Case.STRANGER else []
        near = Nearest([*others, person])
        follow = VipFollowAnalytics()
        if not self.guarded:
            follow.controller.guard = NoGuard(follow.controller.limits)
        lasts = min(LONGEST, LONGEST / self.speed)
        if others:
            lasts = max(4.0 / self.speed, 6.0) + STRANGER_PASSES
        chase = Chase(person, "vest", self.rate, self.latency, seed=self.seed)
        if self.eyes is Sight.TRUTH:
            # Without the guard, nobody knew of those without a vest.
            seen = [(one, "person") for one in others] if self.guarded else []
            sight = TruthPerception(person, "vest", TELLO, bystanders=seen, seed=self.seed)
            flown = chase.fly(follow, sight, turn + lasts, monitor=near)
        else:
            classes = ["vest", "person"] if self.guarded else ["vest"]
            model = VipDetectionAnalytics(classes=classes, threads=1)
            detector = DetectorPerception(world, TELLO, model)
            flown = chase.fly(follow, detector, turn + lasts, monitor=near)
            detector.close()
        return self._judge(near, flown, turn)

    def _judge(self, near: Nearest, flown: ChaseResult, turn: float) -> Meeting:
        path = near.path
        before = min(path, key=lambda row: abs(row[0] - turn))[-1]
        after = flown.after(turn)
        unseen = float((~after.in_view).sum()) / self.rate
        return Meeting(before, near.least, "person_close" in flown.alerts, unseen, turn, path)


def main(
    case: Annotated[
        Case,
        typer.Option(help="Who is followed turns round, or somebody without a vest comes."),
    ] = Case.RETURNS,
    eyes: Annotated[
        Sight,
        typer.Option(help="True boxes with 2 % noise and 3 % misses, or the detector on renders."),
    ] = Sight.TRUTH,
    speeds: Annotated[str, typer.Option(help="Of who comes, m/s.")] = "0.3,0.7,1.0,1.3,1.8",
    rates: Annotated[str, typer.Option(help="Frames a second.")] = "10,5",
    seeds: Annotated[int, typer.Option(help="Flights for each speed and rate.", min=1)] = 10,
    first_seed: Annotated[int, typer.Option(help="The first seed.", min=0)] = 0,
    latency: Annotated[float, typer.Option(help="Seconds from capture to command.")] = 0.25,
    processes: Annotated[int, typer.Option(help="Flights at a time.", min=1)] = 2,
    picture: Annotated[
        Path | None, typer.Option(help="Draw the first meeting of the last case to this file.")
    ] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Have people come at the drone, with the guard against contact and without.

    Aims: never nearer than 0.5 m to who walks at 0.3 to 1.3 m/s, no contact with who walks at 1.8.
    """
    report = Report("meetings", UNITS, packages=["onnxruntime"])
    numbers = range(first_seed, first_seed + seeds)
    drawn: dict[str, Meeting] = {}
    cases = list(product(speeds.split(","), rates.split(","), (False, True)))
    try:
        with ProcessPoolExecutor(processes) as pool:
            for speed, rate, guarded in cases:
                one = Flight(case, eyes, float(speed), float(rate), latency, first_seed, guarded)
                found = list(pool.map(Flight.fly, [replace(one, seed=seed) for seed in numbers]))
                name = "with the guard" if guarded else "without"
                report.row(f"{speed} m/s, {rate} Hz, {name}", _figures(found))
                drawn[name] = found[0]
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    report.note(
        f"{case.value}, {eyes.value} eyes, {seeds} seed(s) from {first_seed}, {latency:g} s from "
        f"capture to command; contact is below {CONTACT} m from a person's axis."
    )
    report.show()
    if json is not None:
        report.write(json)
    if picture is not None:
        speed, rate, _ = cases[-1]
        title = f"{speed} m/s, {rate} frames a second, {latency:g} s of delay, seed {first_seed}"
        ways = {name: (one.turn, np.array(one.path)) for name, one in drawn.items()}
        plot_meeting(ways, title, picture)


def _figures(found: list[Meeting]) -> dict[str, float]:
    least = np.array([one.least for one in found])
    return {
        "flights": float(len(found)),
        "before": float(np.median([one.before for one in found])),
        "nearest": float(least.min()),
        "5 %": float(np.quantile(least, 0.05)),
        "median": float(np.median(least)),
        f"below {KEPT} m": float((least < KEPT).sum()),
        "contact": float((least < CONTACT).sum()),
        "told": float(sum(one.told for one in found)),
        "out of view": float(np.median([one.unseen for one in found])),
    }


if __name__ == "__main__":
    typer.run(main)

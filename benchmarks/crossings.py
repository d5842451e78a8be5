"""Whom a follower follows after another person in a vest has crossed between them.

python benchmarks/crossings.py --seeds 100 --first-seed 0
python benchmarks/crossings.py --alike
"""

from __future__ import annotations

import enum
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from _report import Report

from aerodaas.analytics.detection.vip_detection import VipDetectionAnalytics
from aerodaas.analytics.follow.followers import VipFollowAnalytics
from aerodaas.errors import AeroDaaSError
from aerodaas.simulation.world import Thing
from tools.tuning.chase import TELLO, Chase, ChaseResult
from tools.tuning.meetings import STRANGER, crossing
from tools.tuning.perception import DetectorPerception, TruthPerception
from tools.tuning.walk import PERSON

BEFORE = 4.0
"""Seconds before the crossing at which the followed person must have been chosen."""
WATCHED = 12.0
"""Seconds from the crossing on in which the flight is watched."""
NEAR = 4.5
"""Metres from the drone within which somebody is who it follows, if nobody is nearer."""
TOLD = frozenset({"target_uncertain", "target_lost", "target_given_up"})
"""Alerts that say that the drone may not be with the person whom it followed."""
UNITS = {
    "flights": "",
    "stayed": "flights",
    "held": "flights with neither",
    "switched": "flights",
    "silent": "flights that left without a word",
    "told": "flights",
}


class Sight(str, enum.Enum):
    """What the follower sees by."""

    TRUTH = "truth"
    MODEL = "model"


@dataclass(frozen=True)
class Crossing:
    """Whom one flight followed, `person`, `stranger` or `nobody`."""

    before: str
    """Before the crossing, as the first choice may be either."""
    followed: str
    alerts: list[str]


@dataclass(frozen=True)
class Flight:
    """One crossing to be flown."""

    eyes: Sight
    speed: float
    rate: float
    latency: float
    alike: bool
    seed: int

    def fly(self) -> Crossing:
        """Fly it."""
        world, crossed = crossing(self.speed, self.seed, alike=self.alike)
        person, stranger = world.thing(PERSON), world.thing(STRANGER)
        chase = Chase(person, "vest", self.rate, self.latency, seed=self.seed)
        if self.eyes is Sight.TRUTH:
            others = [(stranger, "vest")]
            sight = TruthPerception(person, "vest", TELLO, bystanders=others, seed=self.seed)
            flown = chase.fly(VipFollowAnalytics(), sight, crossed + WATCHED)
        else:
            model = DetectorPerception(world, TELLO, VipDetectionAnalytics(threads=1))
            flown = chase.fly(VipFollowAnalytics(), model, crossed + WATCHED)
            model.close()
        settled = int(np.searchsorted(flown.time, crossed - BEFORE))
        before, after = (_followed(flown, stranger, row) for row in (settled, -1))
        return Crossing(before, after, flown.alerts)


def _followed(flown: ChaseResult, stranger: Thing, row: int) -> str:
    state = stranger.state(float(flown.time[row]))
    mine = float(flown.distance[row])
    theirs = float(np.hypot(*(flown.place[row] - (state.x, state.y))))
    if min(mine, theirs) > NEAR:
        return "nobody"
    return "person" if mine < theirs else "stranger"


def main(
    eyes: Annotated[
        Sight,
        typer.Option(help="True boxes with 2 % noise and 3 % misses, or the detector on renders."),
    ] = Sight.TRUTH,
    alike: Annotated[bool, typer.Option(help="Both wear the same clothes.")] = False,  # noqa: FBT002
    speeds: Annotated[str, typer.Option(help="Of who crosses, m/s.")] = "0.7,1.3",
    rates: Annotated[str, typer.Option(help="Frames a second.")] = "10,5",
    seeds: Annotated[int, typer.Option(help="Flights for each speed and rate.", min=1)] = 10,
    first_seed: Annotated[int, typer.Option(help="The first seed.", min=0)] = 0,
    latency: Annotated[float, typer.Option(help="Seconds from capture to command.")] = 0.25,
    processes: Annotated[int, typer.Option(help="Flights at a time.", min=1)] = 2,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Have another person in a vest of the same colour cross closely behind the followed one.

    Aims: the drone ends with the other one in at most 5 % of the flights, and never without a
    word; if both wear the same clothes, it holds and says so.
    """
    report = Report("crossings", UNITS, packages=["onnxruntime"])
    try:
        with ProcessPoolExecutor(processes) as pool:
            for speed in speeds.split(","):
                for rate in rates.split(","):
                    one = Flight(eyes, float(speed), float(rate), latency, alike, first_seed)
                    flights = [replace(one, seed=first_seed + number) for number in range(seeds)]
                    found = list(pool.map(Flight.fly, flights))
                    report.row(f"{speed} m/s, {rate} Hz", _figures(found))
    except AeroDaaSError as error:
        typer.echo(error, err=True)
        raise typer.Exit(error.exit_code) from None
    clothes = "the same clothes" if alike else "other clothes under the same vest"
    report.note(
        f"{eyes.value} eyes, {clothes}, {seeds} seed(s) from {first_seed}, {latency:g} s from "
        f"capture to command; judged {WATCHED:g} s after the crossing."
    )
    report.show()
    if json is not None:
        report.write(json)


def _figures(flown: list[Crossing]) -> dict[str, float]:
    found = [one for one in flown if one.before == "person"]
    left = [one for one in found if one.followed != "person"]
    return {
        "flights": float(len(found)),
        "stayed": float(len(found) - len(left)),
        "held": float(sum(one.followed == "nobody" for one in left)),
        "switched": float(sum(one.followed == "stranger" for one in left)),
        "silent": float(sum(not TOLD & set(one.alerts) for one in left)),
        "told": float(sum(bool(TOLD & set(one.alerts)) for one in found)),
    }


if __name__ == "__main__":
    typer.run(main)

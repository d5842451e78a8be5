"""Fly the paper's six applications, judge them, and print their figures beside the paper's.

python benchmarks/paper.py --seeds 20
python benchmarks/paper.py --seeds 1 --speed 1 --only situation_awareness
"""

from __future__ import annotations

import json as json_format
import math
import os
import shutil
import statistics
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer
from _report import machine_line, plain
from missions.catalogue import MISSIONS, Mission
from missions.criteria import Check
from missions.figures import Figures, lines_of_code
from missions.flying import Flown, fly
from rich.console import Console
from rich.table import Table

from aerodaas.errors import AeroDaaSError, UnknownIdError

_PAPER_SAVED = 22.0
"""Metres that nearest neighbour saved in the paper's Disaster Survey."""
_SPARE = 1
"""Cores that a flight keeps busy."""


@dataclass(frozen=True, slots=True)
class Result:
    """One flight, flown and judged."""

    mission: Mission
    seed: int
    flown: Flown
    checks: tuple[Check, ...]
    figures: Figures | None

    @property
    def failures(self) -> list[Check]:
        """Criteria that it misses."""
        return [check for check in self.checks if not check.holds]

    @property
    def ok(self) -> bool:
        """Whether it meets all of them."""
        return not self.failures and self.flown.code == 0


def main(
    seeds: Annotated[int, typer.Option(help="Flights of each application.", min=1)] = 20,
    first: Annotated[int, typer.Option(help="The first seed.", min=0)] = 0,
    only: Annotated[list[str] | None, typer.Option(help="An application; repeat it.")] = None,
    speed: Annotated[
        str, typer.Option(help='"max": simulated time; 1: real time, which the latencies need.')
    ] = "max",
    jobs: Annotated[int, typer.Option(help="Flights at once, at most one a core.", min=1)] = 1,
    keep: Annotated[Path | None, typer.Option(help="Keep recordings and reports here.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Fly, judge and compare. Without --keep, only recordings of failed flights are kept."""
    unknown = [name for name in only or [] if name not in MISSIONS]
    if unknown:
        typer.echo(f"error: {UnknownIdError('application', unknown[0], list(MISSIONS))}", err=True)
        raise typer.Exit(2)
    folder = keep or Path(tempfile.mkdtemp(prefix="paper-"))
    chosen = [MISSIONS[name] for name in (only or MISSIONS)]
    wanted = [(mission, seed) for mission in chosen for seed in range(first, first + seeds)]
    at_once = min(jobs, max(1, len(os.sched_getaffinity(0)) // _SPARE))
    console = Console(width=max(150, Console().width), highlight=False)
    results = []
    with ThreadPoolExecutor(at_once) as pool:
        for result in pool.map(lambda one: _fly(one[0], one[1], folder, speed), wanted):
            results.append(result)
            _tell(console, result)
            if result.ok and keep is None:
                shutil.rmtree(result.flown.recording.parents[1], ignore_errors=True)
    saved = _saved(results, folder, speed)
    _show(console, results, saved, speed)
    if json is not None:
        json.write_text(json_format.dumps(_content(results, saved, speed), indent=2) + "\n")
    raise typer.Exit(0 if all(result.ok for result in results) else 1)


def _fly(mission: Mission, seed: int, folder: Path, speed: str) -> Result:
    flown = fly(mission, seed, folder / f"{mission.name}-{seed}", speed=speed)
    try:
        checks = tuple(mission.judge(flown.recording))
        figures = Figures.of(mission, flown.recording)
    except AeroDaaSError as error:
        text = flown.output.strip().rpartition("\n")[2] or str(error)
        return Result(mission, seed, flown, (Check("flown", holds=False, found=text),), None)
    return Result(mission, seed, flown, checks, figures)


def _tell(console: Console, result: Result) -> None:
    verdict = "ok" if result.ok else "FAILED"
    console.print(f"{result.mission.name} seed {result.seed}: {verdict}", markup=False)
    for check in result.failures:
        console.print(f"  {check.what}: {check.found}", markup=False)
    if result.failures:
        console.print(f"  kept: {result.flown.recording}", markup=False)


def _saved(results: list[Result], folder: Path, speed: str) -> float:
    """Metres by which the Disaster Survey is longer when flown in the order given."""
    nearest = next(
        (one for one in results if one.mission.remote_user and one.ok and one.figures), None
    )
    if nearest is None or nearest.figures is None:
        return math.nan
    ordered = fly(
        nearest.mission,
        nearest.seed,
        folder / "disaster_survey-ordered",
        speed=speed,
        settings={"schedulers.trajectory": "ordered"},
    )
    try:
        return Figures.of(nearest.mission, ordered.recording).distance - nearest.figures.distance
    except AeroDaaSError:
        return math.nan


def _show(console: Console, results: list[Result], saved: float, speed: str) -> None:
    table = Table(
        title=f"the paper's applications at speed {speed}: ours / the paper's (medians)",
        caption=machine_line(),
        caption_justify="left",
    )
    columns = ("met criteria", "duration s", "distance m", "height m", "to command ms")
    for column in ("application", *columns, "overhead ms", "memory GB", "lines"):
        table.add_column(column, justify="left" if column == "application" else "right")
    for mission, group in _grouped(results):
        table.add_row(mission.name, *_cells(mission, group))
    console.print(table)
    if not math.isnan(saved):
        console.print(f"nearest neighbour saves {saved:.1f} m / {_PAPER_SAVED:g} m")
    fast = Table(title="simulated seconds per wall second", caption="aim: 3 with a DNN at 5 fps")
    for column in ("application", "median", "least"):
        fast.add_column(column)
    for mission, group in _grouped(results):
        rates = [rate for one in group if (rate := _rate(one))]
        if rates:
            fast.add_row(mission.name, f"{statistics.median(rates):.1f}", f"{min(rates):.1f}")
    console.print(fast)


def _cells(mission: Mission, group: list[Result]) -> list[str]:
    paper, figures = mission.paper, [one.figures for one in group if one.figures is not None]
    met = f"{sum(one.ok for one in group)} of {len(group)}"
    if not figures:
        return [met]
    low = statistics.median(one.height[0] for one in figures)
    high = statistics.median(one.height[1] for one in figures)
    memory = max(one.flown.memory for one in group) / 1e9
    return [
        met,
        _beside(statistics.median(one.duration for one in figures), paper.duration),
        _beside(statistics.median(one.distance for one in figures), paper.distance),
        f"{low:.2f}-{high:.2f} / {paper.height}",
        _beside(statistics.median(one.latency for one in figures), paper.latency),
        _beside(statistics.median(one.overhead for one in figures), paper.overhead),
        f"{memory:.2f} / {paper.memory:g}",
        f"{lines_of_code(mission.application)} / {paper.lines}",
    ]


def _beside(ours: float, papers: float | None) -> str:
    left = "-" if math.isnan(ours) else f"{ours:.1f}" if ours < 100 else f"{ours:.0f}"  # noqa: PLR2004
    return f"{left} / {'-' if papers is None else f'{papers:g}'}"


def _rate(result: Result) -> float:
    figures = result.figures
    return figures.duration / result.flown.wall if figures and result.flown.wall > 0 else 0.0


def _grouped(results: list[Result]) -> Iterator[tuple[Mission, list[Result]]]:
    groups: dict[str, list[Result]] = defaultdict(list)
    for result in results:
        groups[result.mission.name].append(result)
    for name, group in groups.items():
        yield MISSIONS[name], group


def _content(results: list[Result], saved: float, speed: str) -> dict[str, object]:
    rows = [
        {
            "application": one.mission.name,
            "seed": one.seed,
            "ok": one.ok,
            "checks": {check.what: [check.holds, check.found] for check in one.checks},
            "memory": one.flown.memory,
            "rate": _rate(one),
            **_measured(one.figures),
        }
        for one in results
    ]
    return {"machine": machine_line(), "speed": speed, "saved": plain(saved), "flights": rows}


def _measured(figures: Figures | None) -> dict[str, object]:
    """The figures by name; a height is a range."""
    if figures is None:
        return {}
    numbers = [name for name in Figures.__slots__ if name != "height"]
    measured: dict[str, object] = {name: plain(getattr(figures, name)) for name in numbers}
    measured["height"] = [plain(end) for end in figures.height]
    return measured


if __name__ == "__main__":
    typer.run(main)

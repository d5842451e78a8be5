"""Fly the scripted answers to the 25 tasks of agents, and judge them; no model is needed.

python benchmarks/agents.py
python benchmarks/agents.py --only N3 --only M1

With a model, by hand: give it each request, keep the documents that it proposes as N1-1.json,
N1-2.json, … in a folder, and have them flown and judged:

python benchmarks/agents.py --requests
python benchmarks/agents.py --answers folder
"""

from __future__ import annotations

import json as json_format
import math
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import typer
from _report import machine_line
from agent_tasks.flying import fly
from agent_tasks.tasks import TASKS, Task
from missions.criteria import Check
from rich.console import Console
from rich.progress import track
from rich.table import Table

from aerodaas.dataflow.mission_document import read_mission
from aerodaas.errors import AeroDaaSError, UnknownIdError

__all__ = ["Answer", "Result", "judge", "judge_answers", "pass_interval"]

_CONFIDENT = 1.96
"""Standard deviations of a normal distribution within which 95 % lie."""


@dataclass(frozen=True, slots=True)
class Result:
    """A task's two flights, judged."""

    task: str
    checks: int
    solution: tuple[Check, ...]
    """Checks that the solution fails; none, as it should."""
    miss: tuple[Check, ...]
    """Checks that the near miss fails."""
    as_expected: bool
    """Whether the solution fails none, and the near miss exactly those of its mistake."""
    seconds: float
    """Of both flights on the wall."""


def judge(task: Task, folder: Path) -> Result:
    """Fly a task's solution and its near miss, and judge both.

    Args:
        task: The task.
        folder: Where recordings and documents go, in a folder each.
    """
    began = time.monotonic()
    failed = []
    for name, made in (("solution", task.solution), ("miss", task.miss)):
        place = folder / f"{task.name}-{name}"
        place.mkdir(parents=True)
        evidence = fly(made(), task.environment, place, changes=task.changes)
        checks = [criterion(evidence) for criterion in task.criteria]
        failed.append(tuple(check for check in checks if not check.holds))
    solution, miss = failed
    return Result(
        task.name,
        len(task.criteria),
        solution,
        miss,
        not solution and _is_of_the_mistake(task, miss),
        time.monotonic() - began,
    )


@dataclass(frozen=True, slots=True)
class Answer:
    """A document that somebody proposed for a task, flown and judged."""

    file: str
    failed: tuple[str, ...]
    """Checks that it fails, or why it cannot be flown; none for one that passes."""


def judge_answers(files: Sequence[Path], folder: Path) -> Iterator[Answer]:
    """Fly and judge documents; the part of a file's name before the first `-` is its task.

    Args:
        files: Mission documents.
        folder: Where recordings go, in a folder each.

    Raises:
        UnknownIdError: For a file of no task, before any flies.
    """
    for file in files:
        if _task_of(file) not in TASKS:
            raise UnknownIdError("task", _task_of(file), list(TASKS))
    for file in files:
        task, place = TASKS[_task_of(file)], folder / file.stem
        place.mkdir(parents=True)
        try:
            evidence = fly(read_mission(file), task.environment, place, changes=task.changes)
        except AeroDaaSError as error:
            yield Answer(file.name, (str(error),))
            continue
        checks = [criterion(evidence) for criterion in task.criteria]
        failed = [check for check in checks if not check.holds]
        yield Answer(file.name, tuple(f"{check.what}: {check.found}" for check in failed))


def _task_of(file: Path) -> str:
    return file.stem.partition("-")[0]


def pass_interval(passed: int, tried: int) -> tuple[float, float]:
    """Wilson's interval of a rate of success, at 95 % confidence.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", 1927.

    Args:
        passed: Successes.
        tried: Trials, at least 1.

    Returns:
        The least and the greatest rate, 0 to 1.
    """
    rate, square = passed / tried, _CONFIDENT**2 / tried
    middle = rate + square / 2
    spread = _CONFIDENT * math.sqrt((rate * (1 - rate) + square / 4) / tried)
    return max(0.0, (middle - spread) / (1 + square)), min(1.0, (middle + spread) / (1 + square))


def _is_of_the_mistake(task: Task, failures: tuple[Check, ...]) -> bool:
    """Whether each failed check is one that the mistake names, and each named one has failed."""
    told = [check.what for check in failures]
    return all(any(what.startswith(name) for what in told) for name in task.fails) and all(
        what.startswith(task.fails) for what in told
    )


def main(
    only: Annotated[list[str] | None, typer.Option(help="A task; repeat it.")] = None,
    quick: Annotated[bool, typer.Option(help="Leave out what runs neural networks.")] = False,  # noqa: FBT002
    keep: Annotated[Path | None, typer.Option(help="Keep recordings in this new folder.")] = None,
    json: Annotated[Path | None, typer.Option(help="Write the results to this file.")] = None,
    requests: Annotated[bool, typer.Option(help="Print the requests, and fly nothing.")] = False,  # noqa: FBT002
    answers: Annotated[
        Path | None, typer.Option(help="Judge a model's documents in this folder: N1-1.json, …")
    ] = None,
) -> None:
    """Fly, judge and print; ends with status 1 where one differs from what is expected."""
    if requests:
        for task in TASKS.values():
            typer.echo(f"{task.name} ({task.environment}): {task.request}")
        return
    if answers is not None:
        _judge_model(answers, keep)
        return
    for name in only or []:
        if name not in TASKS:
            typer.echo(f"error: {UnknownIdError('task', name, list(TASKS))}", err=True)
            raise typer.Exit(2)
    chosen = [TASKS[name] for name in only or TASKS]
    chosen = [task for task in chosen if not (quick and task.networks)]
    console = Console(width=max(140, Console().width), highlight=False)
    with tempfile.TemporaryDirectory(prefix="agents-") as temporary:
        folder = keep or Path(temporary)
        results = [judge(task, folder) for task in track(chosen, "flying", console=console)]
    _show(console, results)
    if json is not None:
        content = {"machine": machine_line(), "tasks": [asdict(result) for result in results]}
        json.write_text(json_format.dumps(content, indent=2) + "\n")
    raise typer.Exit(0 if all(result.as_expected for result in results) else 1)


def _judge_model(answers: Path, keep: Path | None) -> None:
    """Judge the documents of a folder, and print the rate of those that pass."""
    files = sorted(answers.glob("*.json"))
    if not files:
        typer.echo(f"error: {answers} holds no document such as N1-1.json", err=True)
        raise typer.Exit(2)
    console = Console(width=max(140, Console().width), highlight=False)
    with tempfile.TemporaryDirectory(prefix="agents-") as temporary:
        try:
            flown = judge_answers(files, keep or Path(temporary))
            judged = list(track(flown, "flying", total=len(files), console=console))
        except UnknownIdError as error:
            typer.echo(f"error: {error}", err=True)
            raise typer.Exit(2) from None
    table = Table(title="a model's answers to the tasks of agents", caption=machine_line())
    for column in ("document", "", "fails at"):
        table.add_column(column)
    for answer in judged:
        table.add_row(answer.file, "" if answer.failed else "passes", "\n".join(answer.failed))
    console.print(table)
    passed = sum(not answer.failed for answer in judged)
    low, high = pass_interval(passed, len(judged))
    console.print(f"{passed} of {len(judged)} pass; 95 % interval {low:.0%} to {high:.0%}")


def _show(console: Console, results: list[Result]) -> None:
    table = Table(title="scripted answers to the tasks of agents", caption=machine_line())
    for column in ("task", "checks", "solution", "near miss", "fails at", "s", ""):
        table.add_column(column)
    for result in results:
        table.add_row(
            result.task,
            str(result.checks),
            "passes" if not result.solution else _told(result.solution),
            TASKS[result.task].mistake,
            _told(result.miss) or "nothing",
            f"{result.seconds:.1f}",
            "ok" if result.as_expected else "DIFFERS",
        )
    console.print(table)


def _told(checks: tuple[Check, ...]) -> str:
    return "\n".join(f"{check.what}: {check.found}" for check in checks)


if __name__ == "__main__":
    typer.run(main)

"""Fly the scripted answers to the 25 tasks of agents, and judge them; no model is needed.

python benchmarks/agents.py
python benchmarks/agents.py --only N3 --only M1
"""

from __future__ import annotations

import json as json_format
import tempfile
import time
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

from aerodaas.errors import UnknownIdError

__all__ = ["Result", "judge"]


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
) -> None:
    """Fly, judge and print; ends with status 1 where one differs from what is expected."""
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

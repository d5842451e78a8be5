"""Lines of the paper's applications here, and written against the vehicles' own libraries.

python benchmarks/lines_of_code.py

One function counts both: lines that hold code, imports among them, without blank lines, comments
and docstrings, as ruff formats them. A program of `baselines/` counts with the modules of that
folder that it imports, as whoever writes one application has to write them. Three other ways of
counting stand beside: with our environment file, which holds what the programs hold as constants,
and more (fence, world); without what runs the networks, which some library may do; and the
program's own file alone, as if another application had brought the modules already.
"""

from __future__ import annotations

import ast
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from _report import Report
from missions.catalogue import APPS
from missions.figures import lines_of_code
from missions.plain import BASELINES, Baseline

UNITS = {
    "ours": "lines",
    "environment": "lines",
    "theirs": "lines",
    "networks": "of these",
    "own file": "of these",
    "ratio": "theirs / ours",
    "with environment": "ratio",
    "without networks": "ratio",
    "own file alone": "ratio",
}
NETWORKS = frozenset({"box_detector", "raised_hand"})
"""Modules of `baselines/` that run a network: its input, its output, boxes and joints."""
_PAPER = 5.0
"""The paper's "up to 5x"."""


def main(
    json: Annotated[Path | None, typer.Option(help="Write the figures to this file.")] = None,
) -> None:
    """Count, and compare with the paper."""
    report = Report("lines of code", UNITS)
    rows = [(one, figures(one)) for one in BASELINES.values()]
    for one, found in rows:
        report.row(one.name, found)
    # Of two programs of one application the shorter counts, which is theirs to choose.
    longest_first = sorted(rows, key=lambda row: -row[1]["theirs"])
    shorter = {one.mission: found for one, found in longest_first}.values()
    medians = {name: statistics.median(found[name] for found in shorter) for name in UNITS}
    report.row("median of the six", medians)
    six = {one.mission: one for one in BASELINES.values() if one.sdk != "mavsdk"}
    report.row("all six, modules once", together(list(six.values())))
    most = max(found["ratio"] for _, found in rows)
    report.note(
        f"The paper: up to {_PAPER:g} times; about 200 lines (analytics) and 130 (waypoints) of a "
        f"PX4, 100 and 70 of a Tello, fewer than 40 of ours. Here: up to {most:.1f} times, "
        f"{medians['ratio']:.1f} in the median."
    )
    report.show()
    if json is not None:
        report.write(json)


def figures(baseline: Baseline) -> dict[str, float]:
    """Lines of one application, in both ways of writing it."""
    return together([baseline])


def together(baselines: Sequence[Baseline]) -> dict[str, float]:
    """Lines of some applications, what several programs import counted once."""
    scripts = {one.script for one in baselines}
    imported = {path for script in scripts for path in modules(script)}
    ours = sum(lines_of_code(APPS / f"{one.mission}.py") for one in baselines)
    environment = sum(map(_environment, baselines))
    theirs = sum(map(lines_of_code, imported))
    networks = sum(lines_of_code(path) for path in imported if path.stem in NETWORKS)
    own = sum(map(lines_of_code, scripts))
    return {
        "ours": ours,
        "environment": environment,
        "theirs": theirs,
        "networks": networks,
        "own file": own,
        "ratio": theirs / ours,
        "with environment": theirs / (ours + environment),
        "without networks": (theirs - networks) / ours,
        "own file alone": own / ours,
    }


def modules(script: Path) -> set[Path]:
    """A program's file, and those beside it that it imports, directly or not."""
    found: set[Path] = set()
    left = [script]
    while left:
        path = left.pop()
        if path in found:
            continue
        found.add(path)
        nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        names = {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
        beside = [path.with_name(f"{name}.py") for name in names]
        left.extend(one for one in beside if one.exists())
    return found


def _environment(baseline: Baseline) -> int:
    path = APPS / "environments" / f"{baseline.environment}.json"
    return sum(bool(line.strip()) for line in path.read_text(encoding="utf-8").splitlines())


if __name__ == "__main__":
    typer.run(main)

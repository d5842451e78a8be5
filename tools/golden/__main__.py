"""Fly the golden flights and compare them with what is kept: `python -m tools.golden`."""

from __future__ import annotations

import json
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from tools.golden.flights import FLIGHTS, FlightFailedError
from tools.golden.summary import differences

_KEPT = Path(__file__).parents[2] / "tests" / "golden"
_SHOWN = 12
"""Differences of one flight that are printed."""


def main(
    names: Annotated[
        list[str] | None, typer.Argument(help="Flights, or the start of names.")
    ] = None,
    *,
    write: Annotated[bool, typer.Option(help="Keep what is flown instead of comparing.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Flights side by side.")] = 2,
) -> None:
    """Fly golden flights and compare trajectory, states, alerts, decisions and counts.

    Flights in simulated time are compared to the last digit. One that a network steers may differ
    by half a metre on another kind of processor, which is told. Flights on emulated autopilots go
    by the wall clock and are compared by their milestones. A change that means to move a flight
    keeps it anew with --write, and its commit explains the difference.
    """
    wanted = [
        name for name in FLIGHTS if not names or any(name.startswith(start) for start in names)
    ]
    if not wanted:
        raise typer.BadParameter(f"no such flight; there are {', '.join(FLIGHTS)}")
    failed = 0
    # Those that go by the wall clock fly alone.
    for width, by_clock in ((jobs, False), (1, True)):
        chosen = [name for name in wanted if FLIGHTS[name].by_clock is by_clock]
        with ThreadPoolExecutor(width) as pool:
            outcomes = pool.map(lambda name: _fly(name, write=write), chosen)
            for name, (outcome, lines) in zip(chosen, outcomes, strict=True):
                typer.echo(f"{name}: {outcome}")
                for line in lines[:_SHOWN]:
                    typer.echo(f"  {line}")
                failed += bool(lines)
    typer.echo(f"{len(wanted) - failed} of {len(wanted)} flights {'kept' if write else 'equal'}")
    raise typer.Exit(1 if failed else 0)


def _fly(name: str, *, write: bool) -> tuple[str, list[str]]:
    """Fly one flight: its outcome in a word, and what differs."""
    flight, path = FLIGHTS[name], _KEPT / f"{name}.json"
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="golden-") as folder:
        try:
            summary = flight.fly(Path(folder))
        except FlightFailedError as error:
            return "failed", str(error).splitlines()
    typer.echo(f"{name} flew for {time.monotonic() - began:.0f} s", err=True)
    if write:
        text = json.dumps(summary, indent=None, separators=(",", ":"))
        path.write_text(text.replace('],"', '],\n"') + "\n", encoding="utf-8")
        return "kept", []
    if not path.is_file():
        return "differs", [f"nothing is kept of it: python -m tools.golden {name} --write"]
    kept, flown = json.loads(path.read_text(encoding="utf-8")), json.loads(json.dumps(summary))
    if flown == kept:
        return "equal", []
    lines = list(differences(kept, flown, near=flight.near))
    return ("differs" if lines else f"equal within {flight.near} m"), lines


if __name__ == "__main__":
    typer.run(main)

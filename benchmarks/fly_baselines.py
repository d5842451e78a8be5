"""Fly the programs of `baselines/`, and judge them as the applications are judged.

python benchmarks/fly_baselines.py
python benchmarks/fly_baselines.py --only farm_survey_pymavlink --seed 3
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated

import typer
from _pace import set_pace
from missions.plain import BASELINES, Baseline, fly

from aerodaas.errors import UnknownIdError


def main(
    only: Annotated[list[str] | None, typer.Option(help="A baseline; repeat it.")] = None,
    seed: Annotated[int, typer.Option(help="Of the world.", min=0)] = 0,
    pace: Annotated[
        float,
        typer.Option(
            help="Time runs so many times as fast as the wall's; not for MAVSDK.", min=0.05
        ),
    ] = 1.0,
    keep: Annotated[Path | None, typer.Option(help="Keep what they write here.")] = None,
) -> None:
    """Fly one after the other; exit with 1 if none flies or one misses a criterion.

    MAVSDK and djitellopy live in environments of their own, whose Pythons AERODAAS_MAVSDK and
    AERODAAS_DJITELLOPY name; what is not named is left out, and told.
    """
    unknown = [name for name in only or [] if name not in BASELINES]
    if unknown:
        typer.echo(f"error: {UnknownIdError('baseline', unknown[0], list(BASELINES))}", err=True)
        raise typer.Exit(2)
    folder = keep or Path(tempfile.mkdtemp(prefix="baselines-"))
    chosen = [BASELINES[name] for name in (only or BASELINES)]
    set_pace(pace)
    ready = [one for one in chosen if _is_ready(one, pace)]
    flown = [_fly(one, folder / f"{one.name}-{seed}", seed, pace) for one in ready]
    raise typer.Exit(0 if flown and all(flown) else 1)


def _is_ready(baseline: Baseline, pace: float) -> bool:
    missing = ""
    if not baseline.python:
        missing = f"AERODAAS_{baseline.sdk.upper()} names no Python"
    elif baseline.sdk == "mavsdk" and pace != 1.0:
        missing = "MAVSDK has clocks of its own, which go at no other pace than the wall's"
    if missing:
        typer.echo(f"{baseline.name}: left out, {missing}")
    return not missing


def _fly(baseline: Baseline, folder: Path, seed: int, pace: float) -> bool:
    flight = fly(baseline, folder, seed=seed, pace=pace)
    checks = flight.judge(baseline.mission)
    met = flight.code == 0 and all(check.holds for check in checks)
    evidence = flight.evidence
    figures = f"{evidence.duration:.0f} s, {evidence.distance:.0f} m"
    typer.echo(f"{baseline.name} seed {seed}: {'ok' if met else 'FAILED'}, {figures}")
    for check in checks:
        typer.echo(f"  {'ok' if check.holds else 'MISSED'} {check.what}: {check.found}")
    if flight.code != 0:
        typer.echo(f"  exit status {flight.code}: {flight.errors.strip()[-2000:]}")
    return met


if __name__ == "__main__":
    typer.run(main)

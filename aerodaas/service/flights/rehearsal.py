"""Rehearsal: the order flown in simulation by the flight's own process, and judged."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.mission_document import read_mission
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.order import FlightOrder, Outcome
from aerodaas.service.flights.process import Flying
from aerodaas.service.rehearsal import judge
from aerodaas.service.rehearsal.picture import draw
from aerodaas.types.errors import AeroDaaSError

__all__ = ["rehearse"]

_NICENESS = 10
"""So that flights under way have the processor first."""


def rehearse(path: Path) -> None:
    """Fly the order in the folder `path` in simulation, and write its verdict and its picture."""
    os.nice(_NICENESS)
    folder = FlightFolder(path)
    order = FlightOrder.read(folder.order)
    os.chdir(folder.path)
    with folder.claim():
        flying = Flying(folder, order)
        outcome = flying.outcome()
        verdict = _verdict(folder, order, flying.config, outcome)
        # The verdict and its picture are all that is kept of it.
        folder.recording.unlink(missing_ok=True)
        folder.end(outcome.model_copy(update={"verdict": verdict}))


def _verdict(
    folder: FlightFolder, order: FlightOrder, config: EnvironmentConfig | None, outcome: Outcome
) -> VerdictOut:
    if config is None or not folder.recording.is_file():
        return VerdictOut(approved=False, reasons=[outcome.reason])
    try:
        verdict = judge(folder.recording, config, minutes=order.minutes, others=order.others)
        # The picture is for people; a flight is not refused for want of it.
        with contextlib.suppress(AeroDaaSError):
            draw(
                folder.recording, folder.picture, config, minutes=order.minutes, others=order.others
            )
    except AeroDaaSError as error:
        return VerdictOut(approved=False, reasons=[f"the rehearsal could not be judged: {error}"])
    here = ", ".join(read_mission(folder.document).here)
    if here:
        told = f"rehearsed without what runs at the user's side: {here}"
        return verdict.model_copy(update={"reasons": [*verdict.reasons, told]})
    return verdict

"""Rehearsal: the order flown in simulation by the flight's own process, and judged."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import psutil

from aerodaas.config.extras import has_extra
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.mission_document import read_mission
from aerodaas.errors import AeroDaaSError
from aerodaas.flights.process import FlightProcess
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder, OtherLease, Outcome
from aerodaas.service.rehearsal.findings import judge, together

__all__ = ["rehearse"]

_NICENESS = 10
"""So that flights under way have the processor first."""
_LOOK_SECONDS = 1.0
"""Wall seconds between two looks at what it uses."""


def rehearse(path: Path) -> None:
    """Fly the order in the folder `path` in simulation, and write its verdict and its picture."""
    os.nice(_NICENESS)
    folder = FlightFolder(path)
    order = FlightOrder.read(folder.order)
    os.chdir(folder.path)
    with folder.claim():
        threading.Thread(target=_watch, args=(folder, order), daemon=True).start()
        outcomes: list[Outcome] = []
        verdicts: list[VerdictOut] = []
        for seeds in [[seed] for seed in order.seeds] or [[]]:
            outcome, verdict = _fly(folder, order, seeds, verdicts)
            outcomes.append(outcome)
            verdicts.append(verdict)
        verdict = together(verdicts)
        here = ", ".join(read_mission(folder.document).here)
        if here:
            told = f"rehearsed without what runs at the user's side: {here}"
            verdict = verdict.model_copy(update={"reasons": [*verdict.reasons, told]})
        shown = next((n for n, one in enumerate(verdicts) if not one.approved), 0)
        folder.end(outcomes[shown].model_copy(update={"verdict": verdict}))


def _fly(
    folder: FlightFolder, order: FlightOrder, seeds: list[int], before: Sequence[VerdictOut]
) -> tuple[Outcome, VerdictOut]:
    """Fly the order with its next seed, and judge the flight.

    The picture shows the first flight that is refused, or else the first one.
    """
    flying = FlightProcess(folder, order.model_copy(update={"seeds": seeds}))
    outcome = flying.outcome()
    if not folder.recording.is_file():
        return outcome, VerdictOut(approved=False, reasons=[outcome.reason], seeds=seeds)
    minutes, others = order.minutes, order.others
    try:
        verdict = judge(folder.recording, flying.config, minutes=minutes, others=others)
        if not before or (not verdict.approved and all(one.approved for one in before)):
            _draw(folder, flying.config, minutes, others)
    except AeroDaaSError as error:
        text = f"the rehearsal could not be judged: {error}"
        verdict = VerdictOut(approved=False, reasons=[text], seeds=seeds)
    # The verdict and its picture are all that is kept of it.
    folder.recording.unlink(missing_ok=True)
    return outcome, verdict


def _draw(
    folder: FlightFolder, config: EnvironmentConfig, minutes: float, others: Sequence[OtherLease]
) -> None:
    """Draw the flight; the picture is for people, and no flight is refused for want of it."""
    if not has_extra("plots"):
        return
    from aerodaas.service.rehearsal.picture import draw  # noqa: PLC0415 - an extra

    with contextlib.suppress(AeroDaaSError):
        draw(folder.recording, folder.picture, config, minutes=minutes, others=others)


def _watch(folder: FlightFolder, order: FlightOrder) -> None:
    """End the process of a rehearsal that uses too much."""
    process = psutil.Process()
    most = order.rehearsal_seconds * max(1, len(order.seeds))
    while True:
        time.sleep(_LOOK_SECONDS)
        processor, memory = time.process_time(), process.memory_info()
        reason = ""
        if processor > most:
            reason = (
                f"its rehearsal used more than {most:g} s of a processor: submit a shorter mission"
            )
        elif memory.rss - memory.shared > order.rehearsal_bytes:
            reason = (
                f"its rehearsal used more than {order.rehearsal_bytes >> 20} MiB of memory: submit "
                "one with fewer drones or waypoints"
            )
        if reason:
            verdict = VerdictOut(approved=False, reasons=[reason])
            ended = time.time()
            folder.end(
                Outcome(landed=False, reason=reason, began=ended, ended=ended, verdict=verdict)
            )
            os.kill(os.getpid(), signal.SIGKILL)

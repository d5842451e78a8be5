"""Rehearsal: the order flown in simulation by the flight's own process, and judged."""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from pathlib import Path

import psutil

from aerodaas.dataflow.mission_document import read_mission
from aerodaas.errors import AeroDaaSError
from aerodaas.flights.process import FlightProcess
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.rehearsal.findings import judge
from aerodaas.service.rehearsal.picture import draw

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
        flying = FlightProcess(folder, order)
        threading.Thread(target=_watch, args=(folder, order), daemon=True).start()
        outcome = flying.outcome()
        verdict = _verdict(folder, order, flying, outcome)
        # The verdict and its picture are all that is kept of it.
        folder.recording.unlink(missing_ok=True)
        folder.end(outcome.model_copy(update={"verdict": verdict}))


def _watch(folder: FlightFolder, order: FlightOrder) -> None:
    """End the process of a rehearsal that uses too much."""
    process = psutil.Process()
    while True:
        time.sleep(_LOOK_SECONDS)
        processor, memory = time.process_time(), process.memory_info()
        reason = ""
        if processor > order.rehearsal_seconds:
            reason = (
                f"its rehearsal used more than {order.rehearsal_seconds:g} s of a processor: "
                "submit a shorter mission"
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


def _verdict(
    folder: FlightFolder, order: FlightOrder, flying: FlightProcess, outcome: Outcome
) -> VerdictOut:
    if not folder.recording.is_file():
        return VerdictOut(approved=False, reasons=[outcome.reason])
    config = flying.config
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

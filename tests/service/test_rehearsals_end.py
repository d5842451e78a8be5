"""Ends of rehearsals: by the end of their service, after which they begin anew, or by bounds."""

from __future__ import annotations

import json
import signal
import time
from pathlib import Path

import psutil
import pytest
from flight_orders import order_in
from served import Served, document, fleet, robot

from aerodaas.service.flights.folder import FlightFolder, start_process

pytestmark = pytest.mark.slow

FAR = [(25.0 * (number % 2), float(number)) for number in range(16)]
"""A way of some minutes, which takes a rehearsal some seconds."""
SECONDS = 60.0


def rehearsal_of(provider: Served) -> psutil.Process:
    """The process of the rehearsal that the service has started."""
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        for process in psutil.Process(provider.process.pid).children():
            if "aerodaas.flights" in process.cmdline():
                return process
        time.sleep(0.05)
    raise AssertionError(provider.log.read_text())


def test_a_rehearsal_ends_with_the_service_that_is_killed() -> None:
    """The mission is rehearsed again by the next service, and approved."""
    with Served(fleet(robot("one", endurance=3600)), "--approval") as provider:
        body = {"document": document("one", *FAR), "minutes": 30}
        id_ = provider.ask("POST", "/v1/missions", body)["id"]
        rehearsal = rehearsal_of(provider)
        provider.stop(signal.SIGKILL)
        rehearsal.wait(SECONDS)
        provider.start()
        found = provider.until_phase(id_, "awaiting_approval")
        assert found["phase"] == "awaiting_approval", found["reason"]


def rehearse(folder: Path, **bounds: object) -> tuple[FlightFolder, int]:
    """Run the process of a rehearsal to its end; returns its folder and exit code."""
    path = folder / "fleet.json"
    path.write_text(json.dumps(fleet(robot("one", endurance=3600))), encoding="utf-8")
    order = order_in(
        folder, ends=time.time() + 1800, minutes=30, speed="max", rehearsal=True, **bounds
    )
    made = FlightFolder(folder / "r")
    made.make(order, json.dumps(document("one", *FAR)))
    with start_process(made, tied=True, vehicles=False) as process:
        return made, process.wait(3 * SECONDS)


@pytest.mark.parametrize(
    ("bounds", "told"),
    [({"rehearsal_seconds": 3.0}, "processor"), ({"rehearsal_bytes": 32 << 20}, "memory")],
)
def test_a_rehearsal_that_uses_too_much_is_ended(
    bounds: dict[str, float], told: str, tmp_path: Path
) -> None:
    """Its verdict says what it used too much of."""
    made, code = rehearse(tmp_path, **bounds)
    assert code == -signal.SIGKILL
    outcome = made.outcome()
    assert outcome is not None
    assert outcome.verdict is not None
    assert not outcome.verdict.approved
    assert told in outcome.verdict.reasons[0]


def test_a_rehearsal_within_its_bounds_is_approved(tmp_path: Path) -> None:
    """Its verdict is that of the flight."""
    made, code = rehearse(tmp_path)
    outcome = made.outcome()
    assert code == 0
    assert outcome is not None
    assert outcome.verdict is not None
    assert outcome.verdict.approved, outcome.verdict.reasons


def test_each_seed_is_flown_and_judged(tmp_path: Path) -> None:
    """One verdict tells the seeds of all flights, and one picture is drawn."""
    made, code = rehearse(tmp_path, seeds=[3, 4])
    outcome = made.outcome()
    assert code == 0
    assert outcome is not None
    assert outcome.verdict is not None
    assert outcome.verdict.approved, outcome.verdict.reasons
    assert outcome.verdict.seeds == [3, 4]
    assert not made.recording.exists()

"""Rehearsals of a service that is killed: none goes on, and the next service begins them anew."""

from __future__ import annotations

import signal
import time

import psutil
import pytest
from served import Served, document, fleet, robot

pytestmark = pytest.mark.slow

FAR = [(25.0 * (number % 2), float(number)) for number in range(16)]
"""A way of some minutes, which takes a rehearsal some seconds."""
SECONDS = 60.0


def rehearsing(provider: Served) -> list[psutil.Process]:
    """The rehearsal's process and all that it has started, its simulator's engine among them."""
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        for process in psutil.Process(provider.process.pid).children():
            found = process.children(recursive=True)
            if any("raylet" in one.name() for one in found):
                return [process, *found]
        time.sleep(0.05)
    raise AssertionError(provider.log.read_text())


def left(processes: list[psutil.Process]) -> list[psutil.Process]:
    """Those that have not ended."""
    return [one for one in processes if one.is_running() and one.status() != psutil.STATUS_ZOMBIE]


def test_a_rehearsal_ends_with_the_service_that_is_killed() -> None:
    """With its engine; the mission is rehearsed again by the next service, and approved."""
    with Served(fleet(robot("one", endurance=3600)), "--approval") as provider:
        body = {"document": document("one", *FAR), "minutes": 30}
        id_ = provider.ask("POST", "/v1/missions", body)["id"]
        processes = rehearsing(provider)
        assert len(left(processes)) == len(processes)
        provider.stop(signal.SIGKILL)
        until = time.monotonic() + SECONDS
        while left(processes) and time.monotonic() < until:
            time.sleep(0.1)
        assert left(processes) == []
        provider.start()
        assert provider.mission(id_)["phase"] in {"rehearsing", "awaiting_approval"}
        found = provider.until_phase(id_, "awaiting_approval")
        assert found["phase"] == "awaiting_approval", found["reason"]

"""The monitor's process: it holds what it is told to, and its end lets go of everything."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from scripted_fleet import HANGING, fleet_of

from aerodaas.protocol.schemas import LinkState
from aerodaas.service.monitor import process as processes
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.monitor.reports import WatchedVehicle

pytestmark = pytest.mark.wall_clock


class Told:
    """A monitor over two drones, and what it has told."""

    def __init__(self, folder: Path, fleet: dict[str, Any]) -> None:
        path = folder / "fleet.json"
        path.write_text(json.dumps(fleet), encoding="utf-8")
        self.news: dict[str, WatchedVehicle] = {}
        self.monitor = FleetMonitor(path, folder / "log", self._tell)

    def _tell(self, news: object) -> None:
        self.news = dict(news)  # type: ignore[call-overload]

    def link(self, name: str) -> LinkState:
        """The link to one of them."""
        return self.news.get(name, WatchedVehicle()).link

    def until(self, condition: Callable[[], bool], *wanted: str) -> None:
        """Wait until something holds, with these drones wanted."""
        end = time.monotonic() + 30.0
        while not condition():
            assert time.monotonic() < end, self.news
            self.monitor.hold(wanted)
            time.sleep(0.05)


@pytest.fixture
def told(tmp_path: Path) -> Iterator[Told]:
    """Two simulated drones."""
    made = Told(tmp_path, fleet_of("one", "two"))
    yield made
    made.monitor.close()


def test_what_is_wanted_is_held_and_what_is_not_is_let_go(told: Told) -> None:
    """Each by itself; a drone is free as soon as the monitor has said so."""
    assert told.monitor.released(["one", "two"]), "before it is told to hold anything"
    told.until(lambda: told.link("one") is told.link("two") is LinkState.CONNECTED, "one", "two")
    assert not told.monitor.released(["one"])
    told.monitor.hold(["two"])
    assert not told.monitor.released(["one"]), "it has not said so yet"
    told.until(lambda: told.monitor.released(["one"]), "two")
    assert told.link("one") is LinkState.UNWATCHED
    assert told.link("two") is LinkState.CONNECTED
    assert not told.monitor.released(["one", "two"])


def test_what_it_was_told_last_counts_before_it_has_obeyed(told: Told) -> None:
    """Its older news say nothing of what it is about to open."""
    told.monitor.hold(["one"])
    told.monitor.hold([])
    assert not told.monitor.released(["one"])
    told.until(lambda: told.monitor.released(["one"]))
    assert told.link("one") is not LinkState.CONNECTED


def test_a_monitor_that_is_killed_is_started_again(told: Told) -> None:
    """Meanwhile it holds nothing, and says nothing of what it held."""
    told.until(lambda: told.link("one") is LinkState.CONNECTED, "one")
    process = told.monitor._process
    assert process is not None
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    assert not told.monitor.released(["one"]), "the next one will hold it"
    told.until(lambda: not told.news, "one")
    told.until(lambda: told.link("one") is LinkState.CONNECTED, "one")
    assert told.monitor._process is not process


def test_a_driver_that_hangs_keeps_no_mission_waiting(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process is ended, which lets go of the vehicle."""
    monkeypatch.setattr(processes, "_STUCK_SECONDS", 0.5)
    monkeypatch.setenv("PYTHONPATH", f"{Path(__file__).parent}:{os.environ.get('PYTHONPATH', '')}")
    told = Told(tmp_path, fleet_of("one", driver=HANGING))
    try:
        told.until(lambda: told.link("one") is LinkState.CONNECTING, "one")
        assert not told.monitor.released(["one"])
        told.until(lambda: told.monitor.released(["one"]))
    finally:
        told.monitor.close()

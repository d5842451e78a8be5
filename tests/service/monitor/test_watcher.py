"""The watcher of one vehicle: it finds it, loses it, finds it again, and commands nothing."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator

import pytest
import scripted_vehicle
from scripted_fleet import fleet_of
from scripted_vehicle import Script
from waiting import until

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.health import Verdict
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.protocol.schemas import LinkState
from aerodaas.service.monitor import watcher as watchers
from aerodaas.service.monitor.watcher import VehicleWatcher

READING = {"connect", "read", "preflight", "close"}


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Script:
    """A new script, and pauses that a test can wait for."""
    monkeypatch.setattr(scripted_vehicle, "SCRIPT", Script())
    for name in ("_READ_SECONDS", "_PAUSE", "_LONGEST_PAUSE"):
        monkeypatch.setattr(watchers, name, 0.02)
    monkeypatch.setattr(watchers, "_ANEW_SECONDS", 0.3)
    return scripted_vehicle.SCRIPT


@pytest.fixture
def watcher(script: Script) -> Iterator[VehicleWatcher]:
    """A watcher of a robot with a camera."""
    fleet = fleet_of("one", driver="scripted_vehicle:ScriptedVehicle")
    config = EnvironmentConfig.model_validate(fleet)
    made = VehicleWatcher(config.robots[0], config, lambda: None)
    made.start()
    yield made
    script.armed, script.breaks = False, None
    made.want(wanted=False)
    until(lambda: not made.report.held)


def test_it_reads_and_commands_nothing(watcher: VehicleWatcher, script: Script) -> None:
    """From the first connection to the last; no camera's video is switched on."""
    assert watcher.report.link is LinkState.UNWATCHED
    script.objections = ["no fix"]
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    news = watcher.report
    assert (news.battery, news.position, news.mode) == (0.8, (0.0, 0.0, 0.0), "grounded")
    assert (news.objections, news.held) == (("no fix",), True)
    until(lambda: watcher.report.examined is not None)
    own = watcher.report.health[0]
    assert (own.name, own.value, own.verdict) == ("vehicle", "no fix", Verdict.REFUSED)
    watcher.want(wanted=False)
    until(lambda: not watcher.report.held)
    assert watcher.report.link is LinkState.UNWATCHED
    assert set(script.asked) == READING
    assert script.asked[-1] == "close"
    assert script.sensors == []


def test_connecting_changes_nothing_at_the_vehicle(script: Script) -> None:
    """Whatever a flight would set there: the driver says by which settings it sets nothing."""
    fleet = fleet_of("one", driver="scripted_vehicle:ScriptedVehicle")
    fleet["robots"][0]["settings"] = {"fence": "land", "url": "somewhere"}
    config = EnvironmentConfig.model_validate(fleet)
    watcher = VehicleWatcher(config.robots[0], config, lambda: None)
    watcher.start()
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    watcher.want(wanted=False)
    until(lambda: not watcher.report.held)
    assert script.settings == {"fence": "off", "url": "somewhere"}


def test_one_that_is_unplugged_is_lost_and_found_again(
    watcher: VehicleWatcher, script: Script
) -> None:
    """With the moment when it was last heard, kept however often it is looked for."""
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    script.there, script.breaks = False, OSError("no such device")
    until(lambda: watcher.report.reason == "nobody answers")
    lost = watcher.report
    assert lost.link is LinkState.LOST
    assert lost.since == lost.heard
    script.asked.clear()
    until(lambda: script.asked.count("connect") > 2)
    assert watcher.report.since == lost.since
    script.there, script.breaks = True, None
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    assert watcher.report.reason == ""


def test_one_that_falls_silent_is_connected_anew(watcher: VehicleWatcher, script: Script) -> None:
    """It may be another one by then; one in the air is left to its driver, which waits for it."""
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    script.mode, script.armed = VehicleMode.LOST, True
    until(lambda: watcher.report.link is LinkState.LOST)
    time.sleep(0.5)
    assert script.asked.count("connect") == 1
    script.armed = False
    until(lambda: script.asked.count("connect") > 1)


def test_a_driver_that_raises_in_the_air_is_not_closed(
    watcher: VehicleWatcher, script: Script
) -> None:
    """It is lost meanwhile, and asked again."""
    watcher.want(wanted=True)
    script.mode, script.armed = VehicleMode.MANUAL, True
    until(lambda: watcher.report.mode == "manual")
    script.breaks = OSError("no such device")
    until(lambda: watcher.report.link is LinkState.LOST)
    time.sleep(0.1)
    assert "close" not in script.asked
    script.breaks, script.armed = None, False
    until(lambda: watcher.report.link is LinkState.CONNECTED)


def test_what_is_armed_is_not_let_go_of(watcher: VehicleWatcher, script: Script) -> None:
    """Some drivers land what they are closed over: not with somebody else at the controls."""
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    script.mode, script.armed = VehicleMode.MANUAL, True
    until(lambda: watcher.report.mode == "manual")
    watcher.want(wanted=False)
    time.sleep(0.2)
    assert watcher.report.held
    assert "close" not in script.asked
    script.mode, script.armed = VehicleMode.GROUNDED, False
    until(lambda: not watcher.report.held)
    assert set(script.asked) == READING


def test_one_whose_driver_hangs_is_not_connected(
    watcher: VehicleWatcher, script: Script, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it said last is no news of now: it is lost since then, until it is read again."""
    monkeypatch.setattr(watchers, "_SILENT_SECONDS", 0.3)
    watcher.want(wanted=True)
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    stuck = script.stuck = threading.Event()
    until(lambda: watcher.report.link is LinkState.LOST)
    lost = watcher.report
    assert "has not answered for" in lost.reason
    assert lost.since == lost.heard
    script.stuck = None
    stuck.set()
    until(lambda: watcher.report.link is LinkState.CONNECTED)
    assert watcher.report.reason == ""


def test_the_list_of_one_in_the_air_stays_as_it_was_on_the_ground(
    watcher: VehicleWatcher, script: Script
) -> None:
    """It is the list before take-off; its age says of when it is."""
    watcher.want(wanted=True)
    until(lambda: watcher.report.examined is not None)
    script.armed, script.battery = True, 0.1
    until(lambda: watcher.report.battery == 0.1)
    examined = watcher.report.examined
    heard = watcher.report.heard
    until(lambda: watcher.report.heard != heard)
    assert watcher.report.examined == examined
    charge = next(one for one in watcher.report.health if one.name == "battery")
    assert (charge.value, charge.verdict) == ("80%", Verdict.GOOD)

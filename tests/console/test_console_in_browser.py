"""The console in a real browser: a flight watched, commanded, and found again after a cut."""

from __future__ import annotations

import urllib.parse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from flown import Proxy, Watched
from hovering import console
from pages import button, click_map, passed, until_done, until_state
from required import needs_peer

from aerodaas.messages.frames import Header
from aerodaas.messages.health import HealthItem, HealthReport, Verdict
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import Traffic
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

PLACE = (4.0, -5.0)
"""East and north of a waypoint that the survey does not visit."""


@pytest.fixture
def browser() -> Iterator[Browser]:
    """A browser of the test's own."""
    with Browser() as browser:
        yield browser


def fly_there(page: Page, **values: float) -> None:
    """Fill in the form of a waypoint, and send it."""
    for name, value in values.items():
        page.run(f"document.querySelector('.waypointform [name={name}]').value = '{value}'")
    page.press(".waypointform .primary")


def test_a_flight_is_watched_commanded_and_found_again(browser: Browser, tmp_path: Path) -> None:
    """From start to landing, on a map that is clicked, over a way that is cut once."""
    with Watched(
        "farm_survey", tmp_path, "--set", "quadrotor_base.limits.cruise_speed=2"
    ) as flight:
        address = urllib.parse.urlsplit(flight.pilot)
        proxy = Proxy(address.port or 0)
        page = browser.open(f"http://127.0.0.1:{proxy.port}/#{address.fragment}")
        until_state(page, "enroute", "loitering")
        assert "token" not in page.run("location.href")
        page.until("document.querySelector('[data-testid=video]')?.dataset.stamp > 0")
        assert page.run("document.querySelectorAll('[data-waypoint]').length") == 4

        # The waypoint is more urgent than the survey's, so the drone goes there at once.
        click_map(page, *PLACE)
        page.until("document.querySelector('.waypointform')")
        assert float(page.run("document.querySelector('[name=east]').value")) == pytest.approx(
            PLACE[0], abs=0.2
        )
        fly_there(page, priority=1, hover=1, height=2.5)
        page.until("document.querySelector('.orders li')?.dataset.stage === 'done'")
        assert "visited" in page.text(".orders li")

        page.run(button("pause"))
        until_done(page, "Hold")
        until_state(page, "paused")
        # The flight records its commands; they are no alerts.
        page.until("document.querySelector('[data-testid=given]')")
        assert "pause: accepted" in page.run(
            "document.querySelector('[data-testid=given]').textContent"
        )
        assert "pause" not in page.text(".alerts")

        # Nobody who may only watch can have it go on.
        watcher = browser.open(flight.viewer, 400)
        until_state(watcher, "paused")
        watcher.until("document.querySelectorAll('.command:disabled').length === 5")
        click_map(watcher, *PLACE)
        assert watcher.run("document.querySelector('.waypointform')") is None
        refused = watcher.run(
            "fetch('v1/missions/own/commands', {method: 'POST', headers: {"
            "'Content-Type': 'application/json', Authorization: "
            "`Bearer ${sessionStorage.getItem('aerodaas.token')}`},"
            "body: JSON.stringify({robot: 'quadrotor_base', command: 'resume'})})"
            ".then(answer => answer.status)"
        )
        assert refused == 403
        until_state(watcher, "paused")

        # What is old is shown as old; the way comes back without anybody's doing.
        assert page.complaints() == []
        proxy.cut()
        page.until("document.querySelector('[data-testid=banner]')?.innerText.includes('old')")
        page.until("document.querySelector('[data-testid=age]')?.innerText.includes('stale')")
        proxy.mend()
        page.until("document.querySelector('[data-testid=connection]').innerText === 'live'")
        page.until("document.querySelector('[data-testid=banner]') === null")
        page.until("!document.querySelector('[data-testid=age]').innerText.includes('stale')")

        page.run(button("resume"))
        until_done(page, "Resume")
        page.run(button("return-home"))
        until_done(page, "Return")
        for one in (page, watcher):
            one.until(
                "document.querySelector('[data-testid=banner]')?.innerText.includes('landed')"
            )
        assert flight.ended() == 0
        proxy.close()
    assert passed(flight.recording, PLACE)


def test_boxes_are_drawn_on_their_own_frame(browser: Browser, tmp_path: Path) -> None:
    """Cars that were found, on a picture whose stamp is that of the detections."""
    with Watched("vehicle_tracking", tmp_path) as flight:
        page = browser.open(flight.viewer)
        page.until("document.querySelector('[data-testid=video]')?.dataset.boxes > 0", 120)
        assert "found" in page.text(".stamp")
        assert page.complaints() == []


@pytest.mark.parametrize(("width", "height"), [(400, 800), (1280, 800), (2560, 1440)])
def test_it_fits(browser: Browser, width: int, height: int) -> None:
    """Without a token it asks for one, in windows of a phone and of a wall; nothing is cut off."""
    with console() as (server, _):
        page = browser.open(server.address(), width, height)
        page.until("document.querySelector('.commands')")
        for scheme in ("light", "dark"):
            page.resize(width, height, scheme)
            assert page.run("document.documentElement.scrollWidth - innerWidth") <= 0
            assert page.run(
                "[...document.querySelectorAll('.card, button')].every("
                "one => one.getBoundingClientRect().right <= innerWidth)"
            )
        # By keyboard alone: the map takes the focus, and Enter begins a waypoint.
        page.run("document.querySelector('[data-testid=map]').focus()")
        page.key("Enter")
        page.until("document.querySelector('.waypointform')")
        assert page.complaints() == []
        asked = browser.open(server.address().partition("#")[0])
        asked.until("document.querySelector('input[name=token]')")


def test_what_refuses_a_take_off_stands_first(browser: Browser) -> None:
    """Each item with a sign and a word beside its colour; what is old is shown so."""
    good = HealthItem("gps", "12 satellites", "6 satellites", Verdict.GOOD)
    bad = HealthItem("wind", "12.0 m/s", "at most 10", Verdict.REFUSED, "wait for less wind")
    with console() as (server, run):
        page = browser.open(server.address())
        until_state(page, "enroute")
        page.until("document.querySelector('.preflight:not([open]) .empty')")
        # In the air it is folded; whoever looks unfolds it.
        page.run("document.querySelector('.preflight summary').click()")
        run.health = HealthReport((good, bad), 0.5)
        page.until("document.querySelectorAll('.preflight li').length === 2")
        assert "refused: 1" in page.text("[data-testid=preflight]")
        said = page.text(".preflight ul").split("\n")
        assert said[:4] == [
            "✕",
            "wind 12.0 m/s, should be at most 10",
            "wait for less wind",
            "refuses",
        ]
        assert said[4:] == ["✓", "GPS 12 satellites", "ok"]
        run.health = HealthReport((good,), 61.0)
        page.until("document.querySelector('.preflight ul.old')")
        assert "s ago" in page.text(".preflight summary")
        assert "ready" in page.text("[data-testid=preflight]")
        assert page.complaints() == []


def test_other_aircraft_are_on_the_map_until_they_are_gone(browser: Browser) -> None:
    """With callsign, height above the drone and heading; dimmed when old, and read out."""
    there = np.array([3.0, 5.0, 123.0])
    east = np.array([20.0, 0.0, 0.0])
    with console() as (server, run):
        page = browser.open(server.address())
        until_state(page, "enroute")
        assert page.run("document.querySelector('[data-aircraft], .legend .aircraft')") is None
        unknown = np.array([-2.0, 1.0, np.nan])
        run.traffic = (
            Traffic(1, "DLH4", there, east, 0.5),
            Traffic(2, "0000B2", unknown, np.zeros(3), 6.0),
        )
        page.until("document.querySelectorAll('[data-aircraft]').length === 2")
        assert page.run("document.querySelector('[data-aircraft=DLH4] text').textContent") == (
            "DLH4 120 m above, 090°"
        )
        assert page.run("document.querySelector('.traffic.stale text').textContent") == (
            "0000B2 height unknown, 6 s old"
        )
        assert page.run("document.querySelectorAll('.traffic.stale').length") == 1
        said = page.run("document.querySelector('.legend .aircraft').textContent")
        assert said == ("aircraft: DLH4 120 m above, 090°; 0000B2 height unknown, heading unknown")
        run.traffic = ()
        page.until("document.querySelector('[data-aircraft]') === null")
        assert page.complaints() == []


def test_battery_and_alerts_are_told_ahead(browser: Browser) -> None:
    """What the plan needs, red where the battery has less; a tone for each alert, once asked for.

    The tones are counted: what a loudspeaker makes of them cannot be heard here.
    """
    with console() as (server, run):
        page = browser.open(server.address())
        page.until("document.querySelector('.state')?.innerText.includes('GPS')")
        said = page.text(".state").replace("\n", " ").lower()
        for words in ("returns at 27 %, in 3:27", "plan needs 61 %", "gps 14 sat., ±1.2 m"):
            assert words in said
        assert "61" in page.text(".state .figure dd.bad")

        page.run(
            "AudioContext.prototype.createOscillator = (make => function () {"
            "window.tones = (window.tones ?? 0) + 1; return make.call(this); })"
            "(AudioContext.prototype.createOscillator)"
        )
        run.alerts.append(Alert(Header(0, 0, "drone"), "wind", "it blows"))
        page.until("document.querySelector('.alerts li.new')?.innerText.includes('it blows')")
        assert page.run("window.tones ?? 0") == 0
        page.press(".alerts [aria-pressed]")
        page.until("window.tones === 2")  # how it will sound
        run.alerts.append(Alert(Header(1, 0, "drone"), "wind", "it blows harder"))
        page.until("window.tones === 4")
        assert page.complaints() == []

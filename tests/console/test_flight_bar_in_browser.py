"""What stays in sight of a flight: its state, the newest alert and the commands, at every size."""

from __future__ import annotations

import json
import urllib.parse
from collections.abc import Iterator

import pytest
from flown import Proxy
from hovering import Run, console
from pages import button, until_done, until_state
from required import needs_peer

from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState
from aerodaas.messages.readings import Alert
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

PINNED = ["[data-testid=now]", "[data-testid=newest-alert]"] + [
    f".command.{word}" for word in ("pause", "return-home", "land")
]
ENABLED = "document.querySelectorAll('.command:not(:disabled)').length"
DISCONNECTED = "document.querySelector('[data-testid=connection]').innerText !== 'live'"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """A browser for all tests; each page has a profile of its own."""
    with Browser() as browser:
        yield browser


def add_alert(run: Run, kind: str, text: str) -> None:
    """Have the flight raise an alert."""
    run.alerts.append(Alert(Header(len(run.alerts), 0, "drone"), kind, text))


def on_top(page: Page, selector: str) -> bool:
    """Whether the middle of an element is in the window, with nothing above it."""
    found: bool = page.run(
        "(one => { const box = one.getBoundingClientRect();"
        "const top = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);"
        "return box.left >= 0 && box.right <= innerWidth && box.top >= 0 &&"
        "box.bottom <= innerHeight && top !== null && (one.contains(top) || top.contains(one)); })"
        f"(document.querySelector({json.dumps(selector)}))"
    )
    return found


@pytest.mark.parametrize(
    ("width", "height"), [(1360, 850), (1920, 1080), (1200, 800), (390, 844), (844, 390)]
)
def test_state_alert_and_commands_stay_in_sight(browser: Browser, width: int, height: int) -> None:
    """However far the page is scrolled; no button is larger than another."""
    with console() as (server, run):
        add_alert(run, "wind", "the wind is 9.2 m/s, near the limit of 10 m/s " * 3)
        page = browser.open(server.address(), width, height)
        until_state(page, "enroute")
        page.until("document.querySelector('[data-testid=newest-alert] .badge')")
        for place in ("0", "one.scrollHeight"):
            page.run(
                "for (const one of [document.scrollingElement, ...document.querySelectorAll('*')])"
                f"one.scrollTop = {place}"
            )
            assert [one for one in PINNED if not on_top(page, one)] == []
        widths = page.run("[...document.querySelectorAll('.command')].map(one => one.offsetWidth)")
        assert max(widths) - min(widths) <= 1
        assert page.run("document.querySelector('.mapbox').offsetHeight") > 100


def test_commands_are_no_alerts(browser: Browser) -> None:
    """The flight's record of them is a list of its own; what else it tells is an alert."""
    with console() as (server, run):
        page = browser.open(server.address())
        until_state(page, "enroute")
        add_alert(run, "console_command", "the console asked drone to pause: accepted")
        add_alert(run, "wind", "it blows")
        page.until("document.querySelector('.alerts li.new')")
        assert page.text("[data-testid=alerts]") == "1 new"
        assert "pause" not in page.text(".alerts")
        assert "pause" in page.run("document.querySelector('[data-testid=given]').textContent")
        page.press("[data-testid=newest-alert] button")
        page.until("document.querySelector('.alerts li.old')")
        assert "no new alert" in page.text("[data-testid=newest-alert]")


@pytest.mark.parametrize("state", [MissionState.RETURNING, MissionState.LANDING])
def test_a_drone_that_goes_home_has_no_plan(browser: Browser, state: MissionState) -> None:
    """What is left of it can neither be rearranged nor flown, and holding is over."""
    with console() as (server, run):
        page = browser.open(server.address())
        page.until("document.querySelector('[data-testid=to-go]')?.innerText.startsWith('1 to go')")
        page.until("document.querySelector('.way')")
        run.mission_state = state
        page.until("document.querySelector('[data-testid=to-go]').innerText.includes('1 left out')")
        assert page.run("document.querySelectorAll('.plan button').length") == 0
        assert page.run("document.querySelector('.way')") is None
        assert page.run("document.querySelector('.command.pause').disabled")


def test_commands_are_off_while_nothing_reaches_the_server(browser: Browser) -> None:
    """They come back with the connection."""
    with console() as (server, _):
        address = urllib.parse.urlsplit(server.address())
        proxy = Proxy(address.port or 0)
        page = browser.open(f"http://127.0.0.1:{proxy.port}/#{address.fragment}")
        page.until(f"{ENABLED} > 0")
        proxy.cut()
        page.until(f"{ENABLED} === 0 && {DISCONNECTED}")
        assert page.run("document.querySelector('.hand .take').disabled")
        proxy.mend()
        page.until(f"{ENABLED} > 0")
        proxy.close()


def test_commands_stay_while_the_live_view_alone_is_lost(browser: Browser) -> None:
    """A drone is commanded by requests of their own, which the server still answers."""
    with console() as (server, run):
        page = browser.open("about:blank")
        page.before("window.WebSocket = function () { return { close() {} }; }")
        page.go(server.address())
        page.until("document.querySelector('[data-testid=banner]')")
        page.run(button("return-home"))
        page.until("document.querySelector('.orders li')?.dataset.stage === 'accepted'")
        assert len(run.commands) == 1


def test_escape_ends_what_was_begun_wherever_the_focus_is(browser: Browser) -> None:
    """The form of a waypoint, the ruler before the survey, and a landing that waits for a yes."""
    with console() as (server, run):
        page = browser.open(server.address())
        until_state(page, "enroute")
        page.run("document.querySelector('[data-testid=map]').focus()")
        page.key("Enter")
        page.until("document.querySelector('.waypointform')")
        page.run("document.activeElement.blur()")
        page.key("Escape")
        page.until("!document.querySelector('.waypointform')")

        page.press(".mapkeys .draw")
        page.press(".mapkeys [title^=Measure]")
        page.run("document.activeElement.blur()")
        page.key("Escape")
        page.until("!document.querySelector('[data-testid=measured]')")
        assert page.run("document.querySelector('.surveyform') !== null")
        page.key("Escape")
        page.until("!document.querySelector('.surveyform')")

        page.run(button("land"))
        page.until("document.querySelector('.command.land').innerText.includes('sure')")
        page.key("Escape")
        page.until("!document.querySelector('.command.land').innerText.includes('sure')")
        assert run.commands == []
        page.run(button("land"))
        page.until("document.querySelector('.command.land').innerText.includes('sure')")
        page.run(button("land"))
        run.mission_state = MissionState.LANDING
        until_done(page, "Land")

"""A survey drawn and flown, a plan rearranged, and a drone flown by hand, in a real browser."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from flown import Watched
from pages import button, click_map, passed, until_done, until_state
from required import needs_peer

from aerodaas.recording.reader import Recording
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

AREA = [(-7.0, -7.0), (-3.0, -7.0), (-3.0, -2.0), (-7.0, -2.0)]
CONTROLS = "document.querySelector('[data-testid=controls]').innerText"


@pytest.fixture
def browser() -> Iterator[Browser]:
    """A browser of the test's own."""
    with Browser() as browser:
        yield browser


def draw(page: Page, *corners: tuple[float, float]) -> None:
    """Draw an area on the map, and wait for its plan."""
    page.press(".mapkeys .draw")
    page.until("document.querySelector('.surveyform')")
    for corner in corners:
        click_map(page, *corner)
    page.until(f"document.querySelectorAll('.corner').length === {len(corners)}")


def fill(page: Page, name: str, value: str) -> None:
    """Type into a field of the survey's form."""
    page.run(
        f"(field => {{ field.value = {value!r};"
        "field.dispatchEvent(new Event('input', {bubbles: true})); })"
        f"(document.querySelector('.surveyform [name={name}]'))"
    )


def place(page: Page, selector: str) -> tuple[float, float]:
    """The middle of an element in the window, which comes into view."""
    found = json.dumps(selector)
    page.run(f"document.querySelector({found}).scrollIntoView({{block: 'center'}})")
    x, y = page.run(
        "(b => [b.x + b.width / 2, b.y + b.height / 2])"
        f"(document.querySelector({found}).getBoundingClientRect())"
    )
    return x, y


def plan(page: Page) -> list[str]:
    """What the page says that is coming."""
    found: list[str] = page.run(
        "[...document.querySelectorAll('[data-coming]')].map(one => one.dataset.plan)"
    )
    return found


def speeds(path: Path) -> list[tuple[float, float]]:
    """Seconds of mission time and speed, by the simulator's own truth."""
    with Recording.open(path) as recording:
        return [
            (record.value.stamp / 1e9, math.hypot(*record.value.truth.velocity))
            for record in recording.records(schemas=["aerodaas.VehicleState"])
            if record.value.truth is not None
        ]


def figure(name: str) -> str:
    """Script of a figure of the state."""
    return (
        "parseFloat([...document.querySelectorAll('.state .figure')]"
        f".find(one => one.innerText.startsWith('{name}')).querySelector('dd').innerText)"
    )


def survey(page: Page) -> list[str]:
    """Draw an area, mend it, and have it flown; returns its waypoints."""
    draw(page, AREA[0], AREA[1], AREA[2], (-17.0, -2.0))
    page.until("document.querySelector('[data-testid=survey-problem]')")
    assert ") lies 2." in page.text("[data-testid=survey-problem]")
    assert page.run("document.querySelector('.surveyform .primary').disabled")
    scale = page.run("Number(document.querySelector('[data-testid=map]').dataset.scale)")
    x, y = place(page, "[data-corner='3'] circle")
    page.drag(x, y, x + 10 * scale, y)
    fill(page, "width", "2.5")
    fill(page, "height", "3")
    page.until("document.querySelector('[data-testid=survey-plan]')?.innerText.includes('2.5 m')")
    assert "2 of 2.5 m" in page.text("[data-testid=survey-plan]").replace("\n", " ")
    assert page.run("document.querySelectorAll('.survey .sweeps').length") == 1
    page.press(".surveyform .primary")
    until_done(page, "survey")
    return [one for one in plan(page) if one.startswith("s")]


def rearrange(page: Page, last: str) -> None:
    """Drag a waypoint to the top of the plan, and leave the field's own out by keys."""
    x, y = place(page, f"[data-plan='{last}'] .handle")
    top = page.run("document.querySelector('[data-coming]').getBoundingClientRect().top")
    page.drag(x, y, x, top + 2)
    until_done(page, "order")
    assert plan(page)[0] == last
    for name in ("wp2", "wp3", "wp4"):
        page.run(f"document.querySelector('[data-plan={name}] .handle').focus()")
        page.key("Delete")
        until_done(page, f"leave out {name}")


def take_over(page: Page, watcher: Page) -> None:
    """Fly by hand with a key held down; others see by whom, and may not take over."""
    page.front()
    page.press(".hand .take")
    page.until(f"{CONTROLS}.startsWith('you')")
    page.hold("KeyD", "d")
    page.until(f"{figure('Speed')} > 1")
    watcher.until(f"{CONTROLS} === 'pilot has the controls'")
    assert watcher.run("document.querySelector('.hand .take').disabled")
    # The reason follows with the next turn of the drone's loop.
    watcher.until(
        "document.querySelector('[data-testid=why]').textContent.includes('flown by hand by pilot')"
    )


def leave(page: Page, watcher: Page) -> None:
    """A page that is not looked at does not fly: hidden, it lets go with the key still down.

    Pages of a browser without a screen are never hidden by another one, so it is told that it is.
    """
    hidden = "Object.defineProperty(document, 'hidden', {value: true, configurable: true})"
    page.run(f"{hidden}; document.dispatchEvent(new Event('visibilitychange'))")
    watcher.until(f"{CONTROLS} === 'nobody has the controls'", 5)
    watcher.until(f"{figure('Speed')} < 0.3", 10)
    assert "window was left" in page.text(".hand .why")
    page.run("delete document.hidden")


def test_an_area_is_surveyed_a_plan_rearranged_and_a_drone_flown_by_hand(
    browser: Browser, tmp_path: Path
) -> None:
    """One flight: an area drawn and flown, its plan dragged, and the page of its pilot killed."""
    with Watched(
        "farm_survey", tmp_path, "--set", "quadrotor_base.limits.cruise_speed=3"
    ) as flight:
        page = browser.open(flight.pilot, 1280, 1000)
        watcher = browser.open(flight.pilot, 1000, 900)
        page.front()
        until_state(page, "enroute", "loitering")
        waypoints = survey(page)
        assert len(waypoints) == 4
        rearrange(page, waypoints[-1])
        take_over(page, watcher)
        leave(page, watcher)
        take_over(page, watcher)
        # The browser itself tells of the area that was refused.
        assert [one for one in page.complaints() if "422" not in one] == []

        # The page ends with the key down: the drone stands, and somebody else resumes.
        page.kill()
        watcher.until(f"{CONTROLS} === 'nobody has the controls'", 5)
        at = watcher.run(figure("Mission time"))
        until_state(watcher, "paused")
        watcher.until(f"{figure('Mission time')} > {at} + 4")
        watcher.run(button("resume"))
        until_done(watcher, "Resume")
        banner = "document.querySelector('[data-testid=banner]')"
        watcher.until(f"{banner}?.innerText.includes('landed')", 90)
        assert watcher.complaints() == []
        assert flight.ended() == 0
    # The page of a busy machine may show a time that is some tenths of a second old.
    stood = [speed for when, speed in speeds(flight.recording) if at + 2 < when < at + 4]
    assert stood
    assert max(stood) < 0.4
    for east in (-5.75, -4.25):
        for north in (-7.0, -2.0):
            assert passed(flight.recording, (east, north))
    assert not passed(flight.recording, (10.0, 10.0))

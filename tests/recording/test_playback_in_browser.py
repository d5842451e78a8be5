"""A recording in a real browser: map, picture and state are those of the moment shown."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from played import served
from required import needs_peer
from synthetic_flight import SyntheticFlight, record

from aerodaas.messages.detections import Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.recording.pictures import shots
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

TIMES = (20.0, 20.3, 71.37, 33.03, 0.9, 60.1)
"""Forwards and back, in different states, with boxes and without."""
DRONE = (
    "(() => { const map = document.querySelector('[data-testid=map]').dataset;"
    "const box = document.querySelector('[data-testid=map]').getBoundingClientRect();"
    "const at = document.querySelector('[data-drone]').transform.baseVal[0].matrix;"
    "return [+map.east + (at.e - box.width / 2) / map.scale,"
    "+map.north - (at.f - box.height / 2) / map.scale]; })()"
)
BAR = "document.querySelector('[data-testid=seek]')"
SEEK = (
    "(bar => {{ bar.value = {}; bar.dispatchEvent(new Event('input', {{bubbles: true}})); }})"
    f"({BAR})"
)
HALVES = "[...document.querySelectorAll('.half')]"
TIME = "Number(document.querySelector('[data-testid=time]').dataset.time)"


class HalfAnalysed(SyntheticFlight):
    """A flight in which nothing is found in every other picture."""

    def messages(self) -> Iterator[Message[Any]]:
        """What the streams carry."""
        for message in super().messages():
            item = message.item
            if not (isinstance(item, Detections) and item.header.id % 2):
                yield message


class LateCamera(SyntheticFlight):
    """A flight whose camera begins after three seconds."""

    def messages(self) -> Iterator[Message[Any]]:
        """What the streams carry."""
        for message in super().messages():
            if not (isinstance(message.item, Frame) and message.item.header.stamp < 3e9):
                yield message


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey of 88 s with four pictures a second."""
    path = tmp_path_factory.mktemp("played") / "flight.mcap"
    record(path, HalfAnalysed(frames=4.0, hover=0.5))
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """One for all tests here."""
    with Browser() as browser:
        yield browser


def facts(path: Path) -> tuple[RecordedFlight, dict[int, Any]]:
    """The flight, and where the drone was at each picture, by other code than the page's."""
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording)
        return flight, {shot.header.stamp: shot.odometry for shot in shots(recording)}


def until_stamp(page: Page, stamp: int, boxes: int) -> None:
    """Wait until a picture is shown, with what was found in it."""
    page.until(f"document.querySelector('[data-testid=video]').dataset.stamp === '{stamp}'")
    page.until(f"document.querySelector('[data-testid=video]').dataset.boxes === '{boxes}'")


def pixel(page: Page, x: int, y: int) -> list[int]:
    """Colour of a pixel of the picture as it is drawn."""
    found: list[int] = page.run(
        "[...document.querySelector('[data-testid=video]').getContext('2d')"
        f".getImageData({x}, {y}, 1, 1).data]"
    )
    return found


def test_it_opens_at_its_first_picture(browser: Browser, tmp_path: Path) -> None:
    """Not on a black one; what comes before is there, too, and a moment that is named is shown."""
    path = tmp_path / "late.mcap"
    record(path, LateCamera(frames=4.0))
    first = min(facts(path)[1])
    with served(path) as address:
        page = browser.open(address)
        page.until("document.querySelector('.timeline')")
        until_stamp(page, first, 1)
        assert page.run(TIME) == pytest.approx(first / 1e9)
        page.key("Home")
        page.until("document.querySelector('.video .empty')")
        assert page.run(TIME) < first / 1e9
        page = browser.open(f"{address}&t=0.5")
        page.until("document.querySelector('.video .empty')")


def test_scrubbing_moves_map_picture_state_and_charts_together(
    browser: Browser, path: Path
) -> None:
    """At each moment all agree with what the recording has for it."""
    flight, pictures = facts(path)
    robot = flight.robots["tello"]
    stamps = sorted(pictures)
    analysed = {one.stamp for one in flight.sightings}
    seen = set()
    with served(path) as address:
        page = browser.open(address)
        page.until("document.querySelector('.timeline')")
        for time in TIMES:
            page.run(SEEK.format(time))
            stamp = stamps[bisect_right(stamps, round(time * 1e9)) - 1]
            until_stamp(page, stamp, int(stamp in analysed))
            seen.add(stamp in analysed)
            row = bisect_right(robot.time.tolist(), time) - 1
            east, north, up = robot.position[row]
            shown = page.run(DRONE)
            assert math.dist(shown, (east, north)) < 0.15, time
            state = next(band for band in reversed(robot.bands) if band.start <= time).state
            assert page.text("[data-testid=state]") == state.replace("_", " ")
            said = page.run(f"{BAR}.getAttribute('aria-valuetext')")
            assert said.startswith(f"{time:.1f} of ")
            assert state.replace("_", " ") in said
            assert abs(float(page.text(".state .figure dd").split()[0]) - up) < 0.16
            told = page.text(".state > dl")
            assert "12 sat., ±1.0 m" in " ".join(told.split())
            assert ("Returns at" in told) is (state in {"enroute", "loitering"})
            # The picture itself: a red disc where the drone was; the box's edge is drawn on it.
            x, y, _ = pictures[stamp].position
            red, _, blue, _ = pixel(page, 160 + round(10 * x), 60 + round(6 * y))
            assert red > blue + 60
            edge, inside = pixel(page, 100, 110), pixel(page, 112, 110)
            contrast = sum(abs(one - other) for one, other in zip(edge, inside, strict=True))
            assert (contrast > 60) == (stamp in analysed)
        assert seen == {True, False}
        assert page.complaints() == []


def test_waypoints_and_alerts_are_those_known_by_then(browser: Browser, path: Path) -> None:
    """What comes later is not shown, and going back takes it away again."""
    flight, _ = facts(path)
    alert = flight.alerts[0][0]
    with served(path) as address:
        page = browser.open(address)
        page.until("document.querySelector('.timeline')")
        for time, visited, alerts in ((alert - 0.1, 0, 0), (70.0, 3, 1), (alert + 0.1, 0, 1)):
            page.run(SEEK.format(time))
            page.until(f"document.querySelectorAll('.waypoint.visited').length === {visited}")
            page.until(
                f"document.querySelector('[data-testid=alerts]').innerText[0] === '{alerts}'"
            )
        assert "the battery is at 20 %" in page.text(".alerts")


def test_it_is_played_by_keyboard_and_linked_to_a_moment(browser: Browser, path: Path) -> None:
    """Space, arrows and brackets; the address names the moment, without the token."""
    with served(path) as address:
        page = browser.open(f"{address}&t=30.5")
        page.until("document.querySelector('.timeline')")
        assert page.run(TIME) == 30.5
        page.key("ArrowRight")
        page.key("ArrowRight")
        page.key("ArrowLeft")
        page.until(f"{TIME} === 31.5")
        page.until("location.hash === '#t=31.50'")
        page.run("document.querySelector('[aria-label=Speed]').value = '8'")
        page.run("document.querySelector('[aria-label=Speed]').dispatchEvent(new Event('change'))")
        page.key(" ")
        before = page.run("document.querySelector('[data-testid=video]').dataset.stamp")
        page.until(f"{TIME} > 40")
        page.key(" ")
        page.until("document.querySelector('[data-testid=play]').innerText === 'Play'")
        assert int(page.run("document.querySelector('[data-testid=video]').dataset.stamp")) > int(
            before
        )
        rest = page.run(TIME)
        page.key("]")
        page.until(f"{TIME} > {rest}")
        page.key("End")
        page.until("document.querySelector('[data-testid=state]').innerText === 'landed'")
        # A link followed within the page.
        page.run("location.hash = '#t=12.25'")
        page.until(f"{TIME} === 12.25")
        assert page.complaints() == []


def test_two_flights_show_one_moment(browser: Browser, path: Path, tmp_path: Path) -> None:
    """Beside each other, each drone where it was then, until the end of the longer flight."""
    longer = tmp_path / "longer.mcap"
    record(longer, SyntheticFlight(frames=2.0, hover=3.0))
    robots = [facts(one)[0].robots["tello"] for one in (path, longer)]
    ends = [float(robot.time[-1]) for robot in robots]
    with served(path, longer) as address:
        page = browser.open(f"{address}&t={ends[0] + 3.0:.2f}", 1400, 1000)
        page.until("document.querySelectorAll('[data-drone]').length === 2")
        page.until(f"Math.abs({TIME} - {ends[0] + 3.0:.2f}) < 0.01")
        assert page.run(f"{BAR}.max - {ends[1]}") >= 0
        for time in (20.0, 61.5, 12.25, ends[0] + 4.0):
            page.run(SEEK.format(time))
            page.until(f"Math.abs({TIME} - {time}) < 0.01")
            for half, robot in enumerate(robots):
                row = bisect_right(robot.time.tolist(), min(time, ends[half])) - 1
                shown = page.run(DRONE.replace("document", f"{HALVES}[{half}]"))
                assert math.dist(shown, robot.position[row][:2]) < 0.15, (time, half)
        # A click into a chart of the second moves both.
        page.run(
            "(plot => { const box = plot.getBoundingClientRect(); plot.dispatchEvent("
            "new MouseEvent('click', {bubbles: true, clientX: box.x + box.width / 2})); })"
            f"({HALVES}[1].querySelector('.u-over'))"
        )
        page.until(f"{TIME} < {ends[0]}")
        assert page.complaints() == []
        # The second one alone is played to its own end.
        page.run(f"{HALVES}[1].querySelector('header button').click()")
        page.until("document.querySelectorAll('[data-drone]').length === 1")
        assert page.run(f"{BAR}.max - {ends[1]}") >= 0
        assert page.run("location.hash").startswith("#mission=own-2")

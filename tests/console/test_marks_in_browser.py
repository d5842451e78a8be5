"""What an analysis saw stands on the map where it stands in the world, live and as recorded."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flown import Watched
from hovering import console
from played import served
from required import needs_peer
from standing_person import PERSON, write_flight

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import CameraModel
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]

_MARKS = "[...document.querySelectorAll('.seen')]"
_LABELS = (
    "[...document.querySelectorAll('.seen text')].map(one => one.getBoundingClientRect())"
    ".map(box => [box.left, box.right])"
)
"""They stand in one row."""
_NEAR = 1.0
"""Metres: a box's lower edge is some pixels off, at 8 m."""


@pytest.fixture
def browser() -> Iterator[Browser]:
    """A browser of the test's own."""
    with Browser() as browser:
        yield browser


def drawn(page: Page) -> list[dict[str, Any]]:
    """The marks: name, place on the map in metres by where they are drawn, and ellipse."""
    found: list[dict[str, Any]] = page.run(
        "(map => [...document.querySelectorAll('.seen')].map(one => {"
        "const of = map.dataset, at = one.transform.baseVal[0].matrix;"
        "return {name: one.dataset.seen, fresh: Number(getComputedStyle(one).opacity),"
        "text: one.querySelector('text')?.textContent,"
        "east: Number(of.east) + (at.e - map.clientWidth / 2) / of.scale,"
        "north: Number(of.north) + (map.clientHeight / 2 - at.f) / of.scale,"
        "major: one.querySelector('ellipse').rx.baseVal.value / of.scale / 2}; }))"
        "(document.querySelector('[data-testid=map]'))"
    )
    return found


def require_there(marks: list[dict[str, Any]]) -> None:
    """Require that one person is marked, by a track, where the person stands."""
    assert len(marks) == 1, marks
    (mark,) = marks
    assert mark["name"].startswith("person #")
    assert mark["text"] == mark["name"]
    assert math.dist((mark["east"], mark["north"]), PERSON) < _NEAR, mark
    # The satellites give two metres of it.
    assert 0.1 < mark["major"] < 4.0
    assert mark["fresh"] > 0.5


def test_a_person_is_marked_where_they_stand(browser: Browser, tmp_path: Path) -> None:
    """Live; and in the recording, at a moment that is sought, and not before they were seen."""
    with Watched(write_flight(tmp_path), tmp_path) as flight:
        page = browser.open(flight.viewer)
        page.until(f"{_MARKS}.some(one => one.dataset.seen.startsWith('person #'))", 120)
        # The tracker's mark takes the place of its detector's, as its box does.
        page.until(f"{_MARKS}.length === 1")
        page.until("document.querySelector('[data-testid=video]').dataset.boxes === '1'")
        require_there(drawn(page))
        assert "person #" in page.run("document.querySelector('.legend .sighted').textContent")
        assert page.complaints() == []
        # As it says where it is so that programs read it, too.
        told = page.run("(one => [one.east, one.north])(document.querySelector('.seen').dataset)")
        assert math.dist([float(one) for one in told], PERSON) < _NEAR
        pilot = browser.open(flight.pilot)
        pilot.until("document.querySelector('.command.land:not(:disabled)')")
        for _ in range(2):
            pilot.run("document.querySelector('.command.land').click()")
        assert flight.ended() == 0
    with served(flight.recording) as address:
        page = browser.open(address)
        page.until("document.querySelector('[data-testid=seek]')", 60)
        seek = (
            "(bar => {{ bar.value = {}; bar.dispatchEvent(new Event('input', {{bubbles: true}}));"
            " }})(document.querySelector('[data-testid=seek]'))"
        )
        end = float(page.run("document.querySelector('[data-testid=seek]').max"))
        page.run(seek.format(json.dumps(end * 0.5)))
        page.until(f"{_MARKS}.some(one => one.dataset.seen.startsWith('person #'))")
        page.until(f"{_MARKS}.length === 1")
        require_there(drawn(page))
        page.run(seek.format(0))
        page.until(f"{_MARKS}.length === 0")
        assert page.complaints() == []


class Crowd:
    """A stream with one item: more people than there is room for labels, one of them cut off."""

    def __init__(self, stream: str) -> None:
        self._stream = stream
        self._told = False

    def next_message(self, timeout: float) -> Message[Any]:
        """The item, once; no picture."""
        if self._told or self._stream != "drone/people":
            time.sleep(timeout)
            raise TimeoutError
        self._told = True
        header = Header(1, NANOSECONDS, "drone/cam")
        camera = CameraModel.from_fov(640, 360, 1.2, pitch=np.pi / 2)
        pose = Odometry(np.array([1.0, 2.0, 6.0]), np.zeros(3), np.pi / 2)
        boxes = [(5.0 + 10 * n, 150.0, 9.0 + 10 * n, 200.0) for n in range(50)]
        boxes += [(5.0, 300.0, 9.0, 359.0)]
        people = [Detection(one, "person", 0.9 - 0.01 * n, n) for n, one in enumerate(boxes)]
        found = Detections(header, tuple(people), 640, 360, camera, pose)
        return Message(self._stream, 1, header.stamp, header, 0, (), found)


def test_marks_fade_are_bounded_and_vanish(browser: Browser) -> None:
    """By mission time; labels cover none of a surer one, and whose feet are cut off has no mark."""
    kinds = {"drone/cam": Frame, "drone/people": Detections}
    nodes = {
        name: SimpleNamespace(id=name, item=kind, dormant=False) for name, kind in kinds.items()
    }
    with console() as (server, run):
        run.graph = SimpleNamespace(nodes=nodes, reader=Crowd)  # type: ignore[assignment]
        page = browser.open(server.address(viewer=True))
        page.until(f"{_MARKS}.length === 50")
        shown = drawn(page)
        assert {one["fresh"] for one in shown} == {1.0}
        labelled = [one["text"] for one in shown if "text" in one]
        assert 2 < len(labelled) < 50
        assert labelled[-1] == "person #0"
        lefts, rights = np.array(page.run(_LABELS)).T
        order = np.argsort(lefts)
        assert (rights[order][:-1] < lefts[order][1:]).all()
        run.time = 3.5
        page.until(f"getComputedStyle({_MARKS}[0]).opacity === '0.5'")
        assert {one["fresh"] for one in drawn(page)} == {0.5}
        run.time = 6.1
        page.until(f"{_MARKS}.length === 0")
        assert page.run("document.querySelector('.legend .sighted')") is None
        assert page.complaints() == []

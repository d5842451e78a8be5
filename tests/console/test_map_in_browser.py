"""The map of the console in a real browser: what lies below a flight, and how far it is."""

from __future__ import annotations

import math
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hovering import console
from map_archives import archive_bytes, colour_of, tiles_around, write_archive
from pages import click_map, until_state
from required import needs_peer

from aerodaas.geometry.frames import GeodeticOrigin
from tools.browser import Browser, Page

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock, needs_peer("AERODAAS_BROWSER")]


@pytest.fixture
def browser() -> Iterator[Browser]:
    """A browser of the test's own."""
    with Browser() as browser:
        yield browser


@contextmanager
def serving(handler: type[BaseHTTPRequestHandler]) -> Iterator[int]:
    """A server of this machine; yields its port."""
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()


@contextmanager
def tile_server(asked: list[str]) -> Iterator[int]:
    """A server of green tiles; yields its port, and notes the paths that it is asked for."""
    picture = cv2.imencode(".png", np.full((256, 256, 3), (90, 160, 90), np.uint8))[1].tobytes()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_response(200)
            self.send_header("Content-Type", "image/png")
            self.end_headers()
            self.wfile.write(picture)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its own word
            """Nothing."""

    with serving(Handler) as port:
        yield port


def corner_of(column: float, row: float, level: int) -> tuple[float, float]:
    """Latitude and longitude of a tile's north-west corner, as OpenStreetMap's wiki has it."""
    count = 2**level
    latitude = math.degrees(math.atan(math.sinh(math.pi * (1 - 2 * row / count))))
    return latitude, column / count * 360 - 180


def test_the_world_below_is_seen_and_measured(browser: Browser) -> None:
    """A viewer sees the houses, and measures by mouse and keys."""
    with console(simulation={"world": "campus"}) as (server, _):
        page = browser.open(server.address(viewer=True))
        until_state(page, "enroute")
        page.until("document.querySelectorAll('.scenery .building').length === 4")
        page.run("document.querySelector('[data-testid=map]').focus()")
        page.key("m")
        for place in ((0, 0), (3, 4), (3, 5)):
            click_map(page, *place)
        page.until("document.querySelector('[data-testid=measured]')?.innerText.includes('in all')")
        assert page.text("[data-testid=measured]") == "1.0 m at 000°, 6.0 m in all"
        page.key("Backspace")
        page.until("document.querySelector('[data-testid=measured]').innerText === '5.0 m at 037°'")
        page.key("Escape")
        page.until("document.querySelector('[data-testid=measured]') === null")
        assert page.complaints() == []


def test_tiles_lie_where_they_are_on_the_earth(browser: Browser) -> None:
    """Each one's corners, by the project's own geodesy; the page fetches them from there alone."""
    asked: list[str] = []
    with tile_server(asked) as port:
        tiles = {"url": f"http://127.0.0.1:{port}/{{z}}/{{x}}/{{y}}.png", "attribution": "© nobody"}
        home = {"latitude": 50.1, "longitude": 8.6}
        with console(map_tiles=tiles, home=home) as (server, _):
            page = browser.open(server.address())
            until_state(page, "enroute")
            page.run("document.querySelector('[data-testid=map]').focus()")
            for _ in range(8):
                page.key("-")
            page.until("document.querySelectorAll('.tiles image').length > 3")
            assert page.text(".attribution") == "© nobody"
            drawn = page.run(
                "(map => [...document.querySelectorAll('.tiles image')].map(one => {"
                "const of = map.dataset, box = one.getBBox();"
                "const east = x => (x - map.clientWidth / 2) / of.scale + Number(of.east);"
                "const north = y => (map.clientHeight / 2 - y) / of.scale + Number(of.north);"
                "return [one.getAttribute('href'), east(box.x), north(box.y),"
                "east(box.x + box.width), north(box.y + box.height)]; }))"
                "(document.querySelector('[data-testid=map]'))"
            )
            scale = float(page.run("document.querySelector('[data-testid=map]').dataset.scale"))
            origin = GeodeticOrigin(50.1, 8.6, 0.0)
            pixel = 1.5 / scale
            for href, west, north, east, south in drawn:
                level, column, row = map(int, re.findall(r"/(\d+)", href.partition(str(port))[2]))
                for corner, found in (
                    ((column, row), (west, north)),
                    ((column + 1, row + 1), (east, south)),
                ):
                    place = origin.to_local(*corner_of(*corner, level), 0.0)
                    assert found == pytest.approx(place[:2], abs=pixel)
            assert max(one[3] for one in drawn) > 0 > min(one[1] for one in drawn)
            deadline = time.monotonic() + 20
            while len(set(asked)) < len(drawn) and time.monotonic() < deadline:
                time.sleep(0.1)
            known = {f"http://127.0.0.1:{port}{path}" for path in asked}
            assert known >= {one[0] for one in drawn}
            assert page.complaints() == []


HOME = {"latitude": 50.1, "longitude": 8.6}
PICTURES = """Promise.all([...document.querySelectorAll('.tiles image')].map(one => {
  const picture = new Image(), canvas = document.createElement('canvas');
  picture.src = one.href.baseVal;
  return picture.decode().then(() => {
    const pen = canvas.getContext('2d');
    pen.drawImage(picture, 0, 0);
    return [one.dataset.tile, ...pen.getImageData(128, 128, 1, 1).data.slice(0, 3)];
  });
}))"""
"""Of each tile that is shown: which one it is, and its colour."""


@contextmanager
def archive_server(content: bytes, asked: list[dict[str, str]]) -> Iterator[str]:
    """A server of one file by ranges; yields its address, and notes the requests' headers."""

    class Handler(BaseHTTPRequestHandler):
        def _head(self, status: int) -> None:
            self.send_response(status)
            self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Access-Control-Allow-Headers", "Range")

        def do_OPTIONS(self) -> None:
            self._head(204)
            self.end_headers()

        def do_GET(self) -> None:
            asked.append(dict(self.headers.items()))
            first, last = map(int, self.headers["Range"].removeprefix("bytes=").split("-"))
            part = content[first : last + 1]
            self._head(206)
            self.send_header("Content-Length", str(len(part)))
            self.end_headers()
            self.wfile.write(part)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - its own word
            """Nothing."""

    with serving(Handler) as port:
        yield f"http://127.0.0.1:{port}/city.pmtiles"


def opened(browser: Browser, url: str, **more: Any) -> Iterator[Page]:  # noqa: ANN401 - JSON
    """The page of a flight over a map."""
    with console(map_tiles={"url": url, **more}, home=HOME) as (server, _):
        page = browser.open(server.address())
        until_state(page, "enroute")
        yield page


def test_an_archives_tiles_are_drawn_wherever_it_lies(browser: Browser, tmp_path: Path) -> None:
    """Of a file and of another server: each with its own picture; the token is told to nobody."""
    tiles = tiles_around(50.1, 8.6)
    asked: list[dict[str, str]] = []
    path = write_archive(tmp_path / "city.pmtiles", tiles)
    with archive_server(path.read_bytes(), asked) as url:
        for place in (str(path), url):
            for page in opened(browser, place, attribution="© nobody", max_zoom=20):
                page.until("document.querySelectorAll('.tiles image').length > 0")
                for _ in range(3):
                    shown = page.run(PICTURES)
                    for name, *colour in shown:
                        level, column, row = map(int, name.split("/"))
                        assert level <= 20
                        assert tuple(colour) == colour_of((level, column, row))
                    page.run("document.querySelector('[data-testid=map]').focus()")
                    for _ in range(4):
                        page.key("-")
                    page.until("document.querySelectorAll('.tiles image').length > 3")
                assert page.text(".attribution") == "© nobody"
                assert page.run("document.querySelector('[data-testid=unmapped]')") is None
                assert page.complaints() == []
    assert asked
    assert not any("Authorization" in one for one in asked)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (archive_bytes(tiles_around(50.1, 8.6), 1), "holds vectors"),
        (b"<!doctype html>" * 100, "magic"),
        (archive_bytes(tiles_around(50.1, 8.6))[:127] + bytes(20_000), "damaged"),
    ],
)
def test_what_is_no_archive_is_told_on_the_map(browser: Browser, content: bytes, said: str) -> None:
    """By its name; the flight is seen without."""
    with archive_server(content, []) as url:
        for page in opened(browser, url):
            page.until("document.querySelector('[data-testid=unmapped]')")
            text = page.text("[data-testid=unmapped]")
            assert "city.pmtiles" in text
            assert said in text
            assert page.run("document.querySelectorAll('.tiles image').length") == 0
            assert page.run("document.querySelectorAll('[data-drone]').length") == 1
            assert page.complaints() == []


def test_a_damaged_part_is_told_and_the_rest_is_drawn(browser: Browser, tmp_path: Path) -> None:
    """Where one leaf of its directory is broken."""
    whole = archive_bytes(tiles_around(50.1, 8.6))
    leaves = int.from_bytes(whole[40:48], "little")
    path = tmp_path / "city.pmtiles"
    path.write_bytes(whole[: leaves + 10] + b"\xff" * 40 + whole[leaves + 50 :])
    for page in opened(browser, str(path), max_zoom=21):
        page.until("document.querySelectorAll('.tiles image').length > 0")
        page.run("document.querySelector('[data-testid=map]').focus()")
        for _ in range(22):
            page.key("-")
        page.until(
            "document.querySelector('[data-testid=unmapped]')?.innerText.includes('damaged')"
        )
        assert page.complaints() == []

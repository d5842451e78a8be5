"""What ships of the console is what its source gives."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from hovering import console
from required import needs_peer, peer
from scripted_camera import camera_console

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.service.own.recordings import RecordingServer
from tools.browser import Browser, Page
from tools.wire_schema import SCHEMA, schema_text

_ROOT = Path(__file__).resolve().parents[2]
_SOURCE = _ROOT / "console"
_PAGE = _ROOT / "aerodaas" / "service" / "http" / "page"


def test_the_wires_types_are_the_services() -> None:
    """The schema from which the page's types are made is that of the present models."""
    assert SCHEMA.read_text(encoding="utf-8") == schema_text(), "run: make console"


def test_the_page_asks_nobody_else() -> None:
    """Neither scripts, styles nor fonts of another host."""
    for path in _PAGE.glob("*.[hcj]*"):
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")
        # Of a library's error, for people.
        text = text.replace("https://github.com/protomaps/PMTiles/tree/main/js", "")
        assert "http://" not in text, path
        assert "https://" not in text, path


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the source, with exactly the packages that are locked."""
    copy = tmp_path_factory.mktemp("built") / "console"
    shutil.copytree(_SOURCE, copy, ignore=shutil.ignore_patterns("node_modules"))
    npm(copy, "ci", "--ignore-scripts", "--no-audit", "--no-fund")
    return copy


def npm(folder: Path, *words: str) -> None:
    """Run npm, which must succeed."""
    command = [peer("AERODAAS_NPM"), *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@needs_peer("AERODAAS_NPM")
def test_the_page_that_ships_is_built_from_its_source(source: Path) -> None:
    """To the last byte."""
    npm(source, "run", "build")
    built = source.parent / "aerodaas" / "service" / "http" / "page"
    assert {one.name for one in built.iterdir()} == {one.name for one in _PAGE.iterdir()}
    for one in built.iterdir():
        assert one.read_bytes() == (_PAGE / one.name).read_bytes(), f"{one.name}: make console"


@pytest.mark.slow
@needs_peer("AERODAAS_NPM")
@needs_peer("AERODAAS_BROWSER")
def test_nothing_stands_in_the_way_of_assistive_technology(source: Path, tmp_path: Path) -> None:
    """By axe's rules: the pages of a flight, of depth, of a recording, and of no token."""
    axe = (source / "node_modules" / "axe-core" / "axe.min.js").read_text(encoding="utf-8")
    path = tmp_path / "flight.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=Provenance()) as recorder:
        for second, state in enumerate((MissionState.TAKING_OFF, MissionState.LANDED)):
            status = MissionStatus(second * 10**9, state, "as planned")
            header = Header(second, status.stamp, "drone/mission")
            recorder.write(Message(header.source, second, status.stamp, header, 0, (), status))
    with Browser() as browser, console() as (server, _):
        page = browser.open(server.address())
        page.until("document.querySelector('[data-testid=map]')")
        page.run("document.querySelector('[data-testid=map]').focus()")
        page.key("Enter")
        page.until("document.querySelector('.waypointform')")
        assert objections(page, axe) == []
        page = browser.open(server.address().partition("#")[0])
        page.until("document.querySelector('input[name=token]')")
        assert objections(page, axe) == []
        with camera_console() as filming:
            page = browser.open(filming.address())
            page.until("document.querySelector('.video [aria-pressed]')")
            page.press(".video [aria-pressed]")
            page.until("document.querySelector('[data-testid=scale]')")
            assert objections(page, axe) == []
        playing = RecordingServer("127.0.0.1:0", [Recording.open(path)])
        page = browser.open(playing.address(viewer=True))
        page.until("document.querySelector('.timeline')")
        assert objections(page, axe) == []
        playing.close()


def objections(page: Page, axe: str) -> list[str]:
    """What axe finds, in light and dark colours."""
    found: list[str] = []
    page.run(f"{axe};0")
    for scheme in ("light", "dark"):
        page.resize(1280, 900, scheme)
        found += page.run(
            "axe.run().then(told => told.violations.map("
            "one => `${one.help}: ${one.nodes.map(node => node.html).join()}`))"
        )
    return found

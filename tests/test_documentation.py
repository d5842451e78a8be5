"""The pages say what the code does: their examples fly, their settings exist."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from core_settings import check_table, core_fields, documented
from flying import Flyer
from pydantic import BaseModel

from aerodaas.config import model as module
from aerodaas.config.model import EnvironmentConfig
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = pytest.mark.wall_clock

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def blocks(page: str, kind: str) -> list[str]:
    """The code blocks of a kind on a page."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL)


@contextmanager
def files(folder: Path, **contents: str) -> Iterator[None]:
    """Work in `folder` with these files in it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(sys, "path", [str(folder), *sys.path])
        for name, content in contents.items():
            (folder / name.replace("__", ".")).write_text(content, encoding="utf-8")
        yield


def flight_of(flyer: Flyer) -> RecordedFlight:
    """What was recorded."""
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        assert recording.complete
        return RecordedFlight.read(recording)


def test_the_first_application_flies(flyer: Flyer) -> None:
    """The environment file and the application of the first page fly as printed."""
    (environment,) = blocks("getting-started.md", "json")
    square = blocks("getting-started.md", "python")[0]
    with files(flyer.folder, environment__json=environment), flyer.options():
        exec(square, {"__name__": "__main__"})  # noqa: S102 - our own page
    drone = flight_of(flyer).robots["drone"]
    assert drone.visited == ("corner0", "corner1", "corner2")
    assert drone.outcome.startswith("landed")


@pytest.mark.slow
def test_its_test_passes(tmp_path: Path) -> None:
    """The test of the first application, as printed."""
    (environment,) = blocks("getting-started.md", "json")
    square, _, check = blocks("getting-started.md", "python")[:3]
    names: dict[str, Any] = {}
    with files(tmp_path, environment__json=environment, square__py=square):
        exec(check, names)  # noqa: S102 - our own page
        names["test_it_comes_home"](tmp_path / "flight")


@pytest.mark.slow
def test_acting_in_flight_works_as_shown(flyer: Flyer, capsys: pytest.CaptureFixture[str]) -> None:
    """Reading, pausing, polling and resuming, as printed."""
    (environment,) = blocks("getting-started.md", "json")
    square, act = blocks("getting-started.md", "python")[:2]
    build = square.replace("drone.start_mission()\n", "")
    with files(flyer.folder, environment__json=environment), flyer.options(speed=5.0):
        exec(build + act, {"__name__": "__main__"})  # noqa: S102 - our own page
    drone = flight_of(flyer).robots["drone"]
    assert "paused" in [band.state for band in drone.bands]
    assert drone.visited == ("corner0", "corner1", "corner2")
    assert " m up" in capsys.readouterr().out


@pytest.mark.slow
def test_the_example_plug_ins_fly_together(flyer: Flyer, plugin_folder: Path) -> None:
    """Camera, analysis, scheduler and driver of the page, in one flight."""
    (environment,) = blocks("writing-plugins.md", "json")
    *plugins, application = blocks("writing-plugins.md", "python")
    (plugin_folder / "my_plugins.py").write_text("\n".join(plugins), encoding="utf-8")
    imports = "from my_plugins import *\n"
    importlib.invalidate_caches()
    with files(flyer.folder, environment__json=environment), flyer.options(speed=3.0):
        exec(imports + application, {"__name__": "__main__"})  # noqa: S102 - our own page
    flight = flight_of(flyer)
    assert flight.robots["bot"].visited == ("far", "near")
    assert flight.robots["bot"].outcome.startswith("landed")
    assert flight.frames["bot/board"] > 10
    assert [kind for _, kind, _ in flight.alerts] == ["dark"]


def models() -> dict[str, type[BaseModel]]:
    """The parts of an environment file, by their class."""
    found = {name: thing for name, thing in vars(module).items() if name in module.__all__}
    return {name: thing for name, thing in found.items() if isinstance(thing, type)}


@pytest.mark.parametrize("name", sorted(models()))
def test_every_setting_is_documented_with_its_default(name: str) -> None:
    """No setting of the core is missing, none is invented."""
    check_table(documented()[name], core_fields(models()[name]))


def test_the_example_environment_is_valid() -> None:
    """The whole file that the page shows can be loaded."""
    (example,) = blocks("environment-file.md", "json")
    config = EnvironmentConfig.model_validate(json.loads(example))
    assert [robot.id for robot in config.robots] == ["tello"]


def test_links_between_pages_lead_somewhere() -> None:
    """Every relative link of every page is a file."""
    for page in [ROOT / "README.md", *DOCS.glob("*.md")]:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\((?!https?://|#)([^)#]+)", text):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_tests_that_pages_name_are_there() -> None:
    """Every `tests/…` that a page names is a file, a folder or a pattern of files."""
    for page in [ROOT / "README.md", *DOCS.glob("*.md")]:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"`(tests/[^`\sA-Z:]+)`", text):
            assert list(ROOT.glob(target.rstrip("/"))), f"{page.name}: {target}"

"""The notebooks that ship fly as they are, and show what they speak of."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import nbformat
import pytest
from flying import FLAT, Flyer, hop
from nbclient import NotebookClient

from aerodaas import Environment
from aerodaas.config.options import RunOptions
from aerodaas.environment.run import Run
from aerodaas.errors import ConfigError, MissionError

NOTEBOOKS = Path(__file__).resolve().parents[3] / "docs" / "notebooks"
NAMES = sorted(path.name for path in NOTEBOOKS.glob("*.ipynb"))


def test_notebooks_ship_clean() -> None:
    """Valid, without outputs of somebody's machine; and there are some."""
    assert len(NAMES) >= 2
    for name in NAMES:
        notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
        nbformat.validate(notebook)
        for cell in notebook.cells:
            if cell.cell_type == "code":
                assert not cell.outputs
                assert cell.execution_count is None


def run(name: str, folder: Path) -> dict[str, list[Any]]:
    """Execute a notebook; what each code cell showed, by its first line."""
    notebook = nbformat.read(NOTEBOOKS / name, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    NotebookClient(notebook, timeout=120, resources=resources).execute()
    return {
        cell.source.splitlines()[0]: cell.outputs
        for cell in notebook.cells
        if cell.cell_type == "code"
    }


def shown(outputs: list[Any], kind: str) -> str:
    """What a cell showed of one kind."""
    (found,) = [one.data[kind] for one in outputs if kind in getattr(one, "data", {})][-1:]
    return str(found)


@pytest.mark.slow
@pytest.mark.wall_clock
def test_the_first_flight(tmp_path: Path) -> None:
    """Graph, console, picture, table in flight; then plot and pictures of the recording."""
    cells = run("first_flight.ipynb", tmp_path)
    graph = shown(cells["from aerodaas import AeroListData, Environment, MonitoringAnalytics, "
                        "Waypoint"], "text/vnd.mermaid")  # fmt: skip
    assert "MonitoringAnalytics" in graph
    assert re.search(r'<iframe src="http://127\.0\.0\.1:\d+/#token=', shown(
        cells["env.console()"], "text/html"))  # fmt: skip
    pictures = shown(cells["from aerodaas.extensions import notebook"], "text/html")
    assert pictures.count("data:image/jpeg") == 1
    table = shown(cells["where = notebook.live_table(odometry, seconds=2)"], "text/plain")
    count = re.findall(r"count\s+([\d.]+)", table)
    assert float(count[0]) > 10
    places = "places = notebook.recorded_table(env.run.recording, odometry)"
    assert len(shown(cells[places], "image/png")) > 10_000
    last = shown(cells["notebook.recorded_pictures(env.run.recording, count=4)"], "text/html")
    assert last.count("data:image/jpeg") == 4
    assert list(tmp_path.glob("runs/*/report.html"))
    assert "Traceback" not in json.dumps(cells)


@pytest.mark.slow
@pytest.mark.wall_clock
def test_boxes_and_tables(tmp_path: Path) -> None:
    """A class of a cell flies; vests are boxed in the pictures and rows of the table."""
    cells = run("boxes_and_tables.ipynb", tmp_path)
    pictures = shown(cells["from aerodaas.extensions import notebook"], "text/html")
    assert pictures.count("data:image/jpeg") == 6
    assert len(re.findall(r"vest 0\.\d\d", pictures)) >= 5
    covered = "covered = notebook.recorded_table(env.run.recording, share)"
    assert len(shown(cells[covered], "image/png")) > 10_000
    found = shown(cells["found = notebook.recorded_table(env.run.recording, vests)"], "text/plain")
    assert len(re.findall(r"^[\d.]+ +0\.\d+ ", found, re.MULTILINE)) == 5


@pytest.mark.parametrize(
    ("given", "asked", "factor", "simulated_time"),
    [
        (RunOptions(), None, None, None),
        (RunOptions(), 3, 3.0, False),
        (RunOptions(), "max", None, True),
        (RunOptions(speed=2.0, simulated_time=False), 3, 2.0, False),
        (RunOptions(simulated_time=True), 3, None, True),
    ],
)
def test_the_command_lines_speed_goes_first(
    given: RunOptions,
    asked: Any,  # noqa: ANN401
    factor: float | None,
    simulated_time: bool | None,  # noqa: FBT001
) -> None:
    """What `start_mission(speed=…)` asks for holds where the command line says nothing."""
    options = given.at_speed(asked)
    assert (options.speed, options.simulated_time) == (factor, simulated_time)


@pytest.mark.parametrize("speed", [0, -1, float("nan"), float("inf"), "fast"])
def test_a_speed_that_is_none_is_refused(speed: Any) -> None:  # noqa: ANN401
    """Also where an application gives it."""
    with pytest.raises(ConfigError, match=r'a positive number or "max"'):
        RunOptions().at_speed(speed)


def test_an_applications_speed_reaches_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the robot's method as by the environment's, once for this flight."""
    flown: list[tuple[float | None, bool]] = []
    monkeypatch.setattr(
        Run, "start", lambda run: flown.append((run.options.speed, run.in_simulated_time))
    )
    monkeypatch.setattr(Run, "over", True)
    monkeypatch.setattr(Run, "wait", lambda _: None)
    environment = Environment(Flyer(tmp_path).write(FLAT))
    environment.get_robot_by_id("drone").navigate(hop((1, 1)))
    environment.get_robot_by_id("drone").start_mission(speed=4)
    environment.start_mission(speed=2.5)
    environment.start_mission()
    assert flown == [(4.0, False), (2.5, False), (None, True)]


def test_the_console_is_served_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In flight only; asked again, the same page answers, for who watches by another token."""
    environment = Environment(Flyer(tmp_path).write(FLAT))
    with pytest.raises(MissionError, match="nothing flies"):
        environment.console()
    run = Run(environment)
    environment._mission = run
    with pytest.raises(MissionError, match="nothing to be watched"):
        environment.console()
    monkeypatch.setattr(Run, "_serve", lambda _: None)
    monkeypatch.setattr(run, "_flight", SimpleNamespace())
    with pytest.raises(ConfigError, match="takes host:port"):
        environment.console("localhost")
    first, again, watching = (
        environment.console(), environment.console(), environment.console(viewer=True)
    )  # fmt: skip
    (server,) = run._servers
    server.close()
    assert first == again != watching
    assert first.url.startswith("http://127.0.0.1:")
    assert str(first) == first.url
    assert first.url.partition("token=")[2] not in repr(first)
    assert f'<iframe src="{first.url}"' in first._repr_html_()

"""What `make bench` runs and lists: commands that exist, and figures that the aims name."""

from __future__ import annotations

import importlib.util
import json
import shlex
import sys
from pathlib import Path
from types import ModuleType

import pytest
import typer
from bench_runs import run_benchmark
from typer.main import get_command

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"
sys.path.append(str(FOLDER))

from _aims import AIMS, aim_of  # noqa: E402 - benchmarks are no package
from _comparison import figures  # noqa: E402
from _suite import OTHERS, SPEED  # noqa: E402

COMMANDS = {one.name: ["python", *one.program(), "--json", "figures.json"] for one in SPEED}
COMMANDS |= {name: shlex.split(command) for name, (command, _) in OTHERS.items()}


def loaded(path: Path) -> ModuleType:
    """A benchmark's module, under a name that hides nobody else's."""
    spec = importlib.util.spec_from_file_location(f"benchmark_{path.stem}", path)
    assert spec is not None
    assert spec.loader is not None
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_benchmark_is_listed_once() -> None:
    """A new one is either run or told with its command."""
    files = {path.stem for path in FOLDER.glob("[!_]*.py")} - {"all"}
    assert files == {one.name for one in SPEED} | OTHERS.keys()
    assert len(SPEED) + len(OTHERS) == len(files)


@pytest.mark.parametrize("name", COMMANDS)
def test_its_options_exist(name: str) -> None:
    """Each with a value that its command takes; nothing is run."""
    words = COMMANDS[name][COMMANDS[name].index("python") + 1 :]
    assert words[0] == f"benchmarks/{name}.py"
    app = typer.Typer()
    app.command()(loaded(ROOT / words[0]).main)
    get_command(app).make_context(name, words[1:])


@pytest.mark.parametrize(
    ("name", "shorter"),
    [
        ("decision", "--scheduler margin --rounds 10"),
        ("lab", "--scheduler edf"),
        ("vision", "--rounds 1"),
        *(
            pytest.param(name, shorter, marks=pytest.mark.slow)
            for name, shorter in (
                ("start", "--runs 1 --flights 0"),
                ("start", "--runs 1 --flights 1"),
                ("latency", "--seconds 2"),
                ("hop", ""),
                ("footprint", "--seconds 1"),
                ("simulation", "--seeds 0"),
                ("mavlink", "--seconds 2"),
                ("tello", "--seconds 1"),
            )
        ),
    ],
)
def test_it_runs_to_its_end(name: str, shorter: str, tmp_path: Path) -> None:
    """As in the list but shorter, and measures all that the aims name."""
    out = tmp_path / "figures.json"
    (listed,) = (one for one in SPEED if one.name == name)
    done = run_benchmark(name, *listed.program()[1:], *shorter.split(), "--json", str(out))
    assert done.returncode == 0, done.stdout + done.stderr
    found = figures({"benchmarks": {name: {"reports": [json.loads(out.read_text())]}}})
    assert found
    values = {key: value for key, (value, _) in found.items()}
    wanted = [aim for aim in AIMS if aim.benchmark == name]
    if "--flights 0" in shorter:
        wanted = [aim for aim in wanted if aim.case != "command to take-off"]
    for aim in wanted:
        assert aim in map(aim_of, found), aim
        if "--no-dora" not in listed.program():
            assert aim.bound(values) is not None, aim


def test_no_two_aims_are_of_one_figure() -> None:
    """The first would hide the other."""
    keys = [(aim.benchmark, aim.case, aim.figure) for aim in AIMS]
    assert [aim_of(key) for key in keys] == list(AIMS)
    assert {aim.benchmark for aim in AIMS} <= {one.name for one in SPEED}


@pytest.mark.slow
@pytest.mark.wall_clock
def test_gaps_between_setpoints_are_written(tmp_path: Path) -> None:
    """A setpoint each 50 ms of the flight."""
    out = tmp_path / "figures.json"
    words = ["--seconds", "5", "--busy", "1", "--measures", "--json", str(out)]
    done = run_benchmark("punctuality", *words)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(out.read_text())["rows"]
    assert row["setpoints"] > 50
    assert row["p50"] <= row["p99"] <= row["max"]

"""What people install holds all that a checkout has, the linked folders and the models, too."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path, PurePosixPath

import pytest
from hatchling.builders.wheel import WheelBuilder

_ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout."""
    return _build(_ROOT, tmp_path_factory.mktemp("wheel"))


def _build(root: Path, folder: Path) -> Path:
    (built,) = WheelBuilder(str(root)).build(directory=str(folder), versions=["standard"])
    return Path(built)


def test_the_wheel_holds_the_package_its_links_and_its_data(built: Path) -> None:
    """Code behind links once, models, worlds, types and the report's looks."""
    names = zipfile.ZipFile(built).namelist()
    assert len(names) == len(set(names))
    package = _ROOT / "aerodaas"
    page = ("*.css", "*.js", "*.html", "*.svg")
    kinds = ("*.py", "*.pyi", "*.json", "*.csv", "*.md", "*.onnx", "py.typed", *page)
    wanted = {
        f"aerodaas/{path.relative_to(package)}"
        for folder in (package, package / "actors", package / "apps", package / "schedulers")
        for kind in kinds
        for path in folder.rglob(kind)
    }
    assert any(name.endswith(".onnx") for name in wanted)
    assert wanted <= set(names)


def test_the_wheel_holds_nothing_else(built: Path) -> None:
    """No tests, no workshop, nothing that was left lying about."""
    paths = [PurePosixPath(name) for name in zipfile.ZipFile(built).namelist()]
    assert {path.parts[0].partition("-")[0] for path in paths} == {"aerodaas"}
    package = [path for path in paths if path.parts[0] == "aerodaas"]
    kinds = {path.suffix for path in package if path.name != "py.typed"}
    assert kinds <= {
        *(
            ".py",
            ".pyi",
            ".json",
            ".csv",
            ".onnx",
            ".css",
            ".js",
            ".html",
            ".md",
            ".svg",
            ".toml",
            ".txt",
        )
    }
    assert not [path for path in package if path.name.startswith((".", "test_", "conftest"))]


def test_the_same_sources_make_the_same_wheel(built: Path, tmp_path: Path) -> None:
    """To the last byte, from another folder whose files have other times and permissions."""
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE", ".gitignore"):
        shutil.copyfile(_ROOT / name, copy / name)
    for name in ("actors", "apps", "schedulers", "aerodaas"):
        shutil.copytree(
            _ROOT / name,
            copy / name,
            symlinks=True,
            copy_function=shutil.copyfile,
            ignore=shutil.ignore_patterns("__pycache__"),
        )
    again = _build(copy, tmp_path)
    first, second = (hashlib.sha256(path.read_bytes()).hexdigest() for path in (built, again))
    assert first == second


@pytest.mark.slow
@pytest.mark.wall_clock
@pytest.mark.timeout(900)
def test_a_strangers_first_hour(built: Path, tmp_path: Path) -> None:
    """From the wheel alone, in an empty folder, by the words of the documentation."""
    python = tmp_path / "venv" / "bin" / "python"
    folder = tmp_path / "empty"
    folder.mkdir()

    def run(*words: str | Path, place: Path = folder) -> str:
        variables = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "RAY_"))}
        variables["PATH"] = f"{python.parent}{os.pathsep}{variables['PATH']}"
        ended = subprocess.run(
            words, cwd=place, env=variables, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout

    run(sys.executable, "-m", "venv", python.parents[1])
    run(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", built)
    assert "vehicle_tracking" in run("aerodaas", "examples", "--list")
    run("aerodaas", "run", "farm_survey", "--no-view", "--record", "survey")
    assert "4 of 4 waypoints" in (folder / "survey" / "summary.txt").read_text()
    run("aerodaas", "examples", "farm_survey")
    run("aerodaas", "compile", "examples/farm_survey.py", "-o", "examples/farm_survey.json")
    run("aerodaas", "new", "patrol")
    run("aerodaas", "run", "patrol.py", "--no-view", place=folder / "patrol")
    (flown,) = (folder / "patrol" / "runs").iterdir()
    assert "3 of 3 waypoints" in (flown / "summary.txt").read_text()
    assert "3 of 3 waypoints" in (flown / "report.html").read_text()
    assert "margin" in run("aerodaas", "lab", "run", "--seeds", "1", "--duration", "5")

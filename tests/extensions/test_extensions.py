"""Extensions: found in their folders and in packages; the core works without any of them."""

from __future__ import annotations

import ast
import importlib
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from core_settings import check_table, documented
from flights import add, flight
from pydantic import TypeAdapter

from aerodaas import Waypoint
from aerodaas.config.extensions import Command, Extension, extensions, imported
from aerodaas.config.model import validated
from aerodaas.config.plugins import load_plugin, plugin_names
from aerodaas.config.schema import environment_schema
from aerodaas.errors import ConfigError, InvalidWaypointError, UnknownIdError
from aerodaas.messages.mission import MissionState
from aerodaas.testing.extension_kit import check_extension

_ROOT = Path(__file__).resolve().parents[2]
_FOLDERS = sorted(
    path.parent.name for path in (_ROOT / "aerodaas/extensions").glob("*/extension.py")
)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages, each of whose extensions is found."""
    monkeypatch.syspath_prepend(tmp_path)
    extensions.cache_clear()
    yield tmp_path
    extensions.cache_clear()


def _install(site: Path, package: str, name: str, source: str) -> None:
    """Install a package of one module with one extension."""
    (site / f"{package}.py").write_text(source)
    info = site / f"{package}-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1\n")
    (info / "entry_points.txt").write_text(f"[aerodaas.extensions]\n{name} = {package}:EXTENSION\n")
    importlib.invalidate_caches()


def test_every_folder_is_an_extension_of_its_name() -> None:
    """With a sentence on what it is; whatever it names can be imported."""
    found = extensions()
    assert set(_FOLDERS) <= set(found)
    for name in _FOLDERS:
        extension = found[name]
        assert extension.name == name
        check_extension(extension)


def test_every_setting_of_an_extension_is_documented_with_its_default() -> None:
    """Those that it adds to a section in one table of all extensions, and its own models."""
    tables = documented()
    told, known = tables["extensions"], set[str]()
    for name in _FOLDERS:
        for section, place in extensions()[name].settings.items():
            model = imported(place)
            fields = {f"{section}.{field}": it for field, it in model.model_fields.items()}
            check_table({key: told[key] for key in fields}, fields)
            known |= set(fields)
            for inner in sys.modules[model.__module__].__all__:
                if inner in tables:
                    fields = getattr(sys.modules[model.__module__], inner).model_fields
                    check_table(tables[inner], fields)
    assert set(told) == known


def test_the_published_schema_is_current() -> None:
    """`aerodaas schema > docs/environment.schema.json` would change nothing."""
    published = (_ROOT / "docs/environment.schema.json").read_text(encoding="utf-8")
    assert json.loads(published) == json.loads(environment_schema())


@pytest.mark.parametrize(
    ("extension", "message"),
    [
        (Extension("mine", "No sentence"), "full stop"),
        (Extension("not a name", "Some."), "identifier"),
        (Extension("mine", "Some.", {"drivers": {"a": "nothing_there:A"}}), "nothing_there"),
        (Extension("mine", "Some.", {"drivers": {"a": "json:A"}}), "cannot be imported"),
        (Extension("mine", "Some.", settings={"limits": "json:A"}), "cannot be imported"),
        (Extension("mine", "Some.", {"drivers": {"mavlink": "json:loads"}}), "project's own"),
        (Extension("mine", "Some.", commands=(Command("run", "json:loads", "Run."),)), "'run'"),
        (Extension("mine", "Some.", lab=(Command("a", "nothing_there:A", "A."),)), "nothing_there"),
        (Extension("mine", "Some.", safety_rules=("nothing_there:A",)), "nothing_there"),
        (Extension("mine", "Some.", exports=(Command("csv", "json:loads", "C."),)), "'csv'"),
    ],
)
def test_an_extension_that_breaks_a_rule_is_told(extension: Extension, message: str) -> None:
    """By the kit for its author's tests."""
    with pytest.raises(ConfigError, match=message):
        check_extension(extension)


def test_a_packages_extension_adds_its_plug_ins(site: Path) -> None:
    """By its entry point alone."""
    source = (
        "from aerodaas.config.extensions import Extension\n"
        "from aerodaas.drivers.simulated import SimulatedVehicle\n"
        "class Glider(SimulatedVehicle): pass\n"
        "EXTENSION = Extension('gliders', 'Gliders.', {'drivers': {'glider': 'gliding:Glider'}})\n"
    )
    _install(site, "gliding", "gliders", source)
    assert extensions()["gliders"].summary == "Gliders."
    assert "glider" in plugin_names("drivers")
    assert load_plugin("drivers", "glider").__name__ == "Glider"


SPRAYING = """
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal
from annotated_types import Ge, Unit
from aerodaas.config.extensions import Extension
from aerodaas.messages.actions import Action, Number
from aerodaas.mission.action_executor import ActionExecutor

@dataclass(frozen=True, slots=True)
class Spray(Action):
    purpose: ClassVar[str] = "sprays"
    litres: Annotated[Number, Ge(0.0), Unit("litres")] = 1.0
    type: Literal["spray"] = field(default="spray", repr=False)

class Sprayer(ActionExecutor):
    done = []
    def __init__(self, vehicle, robot, log):
        self.since = None
    @classmethod
    def objection(cls, waypoint, robot):
        spray = waypoint.action(Spray)
        return "the tank holds 5 litres" if spray and spray.litres > 5 else ""
    def attend(self, stop, odometry, now):
        spray = stop.waypoint.action(Spray)
        if spray is None or not stop.arrived:
            return False
        if spray.litres == 3:
            raise RuntimeError("the nozzle is blocked")
        self.since = self.since or now
        if now - self.since < 2e9:
            return True
        if stop.id not in self.done:
            self.done.append(stop.id)
        return False

class Pump(ActionExecutor):
    order = 9
    def __init__(self, vehicle, robot, log):
        pass
    def fail(self, *arguments):
        raise RuntimeError("the pump is broken")
    poll = attend = steer = stops_at = ongoing = interruption = ending = on_state = fail

EXTENSION = Extension(
    "spraying",
    "Sprays.",
    actions=("spraying:Spray",),
    action_executors=("spraying:Sprayer", "spraying:Pump"),
)
"""


def test_a_packages_extension_adds_an_action(site: Path) -> None:
    """A waypoint has it in JSON, and the drone stays until its executor is done.

    It flies on where an executor fails, and lands at the end.
    """
    _install(site, "spraying", "spraying", SPRAYING)
    spraying = importlib.import_module("spraying")
    check_extension(spraying.EXTENSION)
    places = [("field", 1.0), ("blocked", 3.0), ("too much", 9.0)]
    stops = [
        Waypoint(name, 5.0 * number, 0, 2, actions=[spraying.Spray(litres)])
        for number, (name, litres) in enumerate(places)
    ]
    forms = TypeAdapter(Waypoint)
    assert [forms.validate_json(forms.dump_json(stop)) for stop in stops] == stops
    with pytest.raises(InvalidWaypointError, match="litres is in litres"):
        spraying.Spray(-1.0)
    made = flight(add(*stops))
    made.run(until=lambda: made.mission.finished)
    assert made.status.state is MissionState.LANDED
    assert spraying.Sprayer.done == ["field"]
    assert tuple(made.status.visited) == ("field", "blocked")
    texts = [alert.text for alert in made.mission.alerts]
    assert any("Sprayer.attend" in text and "the nozzle is blocked" in text for text in texts)
    assert any("the tank holds 5 litres" in text for text in texts)
    assert any("the pump is broken" in text for text in texts)


@pytest.mark.parametrize("source", ["import nothing_of_this_name\n", "EXTENSION = 3\n"])
def test_a_package_that_is_broken_is_left_out_with_a_warning(
    site: Path, caplog: pytest.LogCaptureFixture, source: str
) -> None:
    """Everything else still works."""
    _install(site, "broken_one", "broken", source)
    assert "broken" not in extensions()
    assert "'broken'" in caplog.text
    assert load_plugin("drivers", "simulated") is not None
    with pytest.raises(UnknownIdError):
        load_plugin("drivers", "broken")


def test_two_extensions_that_add_one_plug_in_are_refused(site: Path) -> None:
    """Both are named, with the remedy."""
    source = (
        "from aerodaas.config.extensions import Extension\n"
        "EXTENSION = Extension('NAME', 'Some.', {'drivers': {'glider': 'gliding:Glider'}})\n"
    )
    _install(site, "first_one", "first", source)
    _install(site, "second_one", "second", source)
    with pytest.raises(ConfigError, match=r"'first' and 'second' both add 'glider'.*uninstall"):
        extensions()


SETTINGS = """
from aerodaas.config.extensions import Extension
from pydantic import BaseModel

class Towing(BaseModel):
    rope: float = 20.0
    \"\"\"Metres.\"\"\"

class TowedLimits(BaseModel):
    towing: Towing | None = None
    \"\"\"What is towed.\"\"\"

EXTENSION = Extension(
    "tow",
    "Towing.",
    settings={"limits": "towing:TowedLimits"},
    recorded_settings=("robots[].limits.towing.rope",),
)
"""

READS = """
import json, pickle
from aerodaas.config.checked import added_settings
from aerodaas.config.model import EnvironmentConfig, LimitsConfig, validated
from aerodaas.config.overrides import overridden
from aerodaas.config.schema import environment_schema
from aerodaas.errors import ConfigError
from aerodaas.recording.recorded_environment import allowed_content
from towing import TowedLimits, Towing

def environment(**limits):
    return validated({"robots": [{"id": "drone", "limits": limits}]}, "here")

def towing(config):
    return added_settings(config.robots[0].limits, TowedLimits).towing

config = environment(towing={"rope": 5})
assert towing(config) == Towing(rope=5.0) and towing(environment()) is None
assert config != environment() and config == pickle.loads(pickle.dumps(config))
assert validated(json.loads(config.model_dump_json(by_alias=True)), "again") == config
assert towing(overridden(config, {"drone.limits.towing": {"rope": 7}})) == Towing(rope=7.0)
limits = json.loads(environment_schema())["$defs"]["LimitsConfig"]["properties"]
assert limits["towing"]["description"] == "What is towed."
recorded = {"robots": [{"limits": {"towing": {"rope": 5, "secret": 1}}}]}
assert allowed_content(recorded) == {"robots": [{"limits": {"towing": {"rope": 5}}}]}
try:
    environment(twoing={})
except ConfigError as error:
    assert "did you mean towing?" in str(error), error
else:
    raise AssertionError("an unknown setting is taken")
"""


def test_a_packages_extension_adds_settings(site: Path) -> None:
    """Of an environment file's section: checked, described, written again and read of recordings.

    A file that uses them without the package is refused with the remedy.
    """
    with pytest.raises(ConfigError, match=r"limits\.towing: .*install that extension"):
        validated({"robots": [{"id": "drone", "limits": {"towing": {}}}]}, "here")
    _install(site, "towing", "tow", SETTINGS)
    variables = {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{_ROOT}"}
    done = subprocess.run(
        [sys.executable, "-c", READS], env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["max_speed", "geofence"])
def test_a_setting_of_the_core_is_no_extensions(site: Path, name: str) -> None:
    """Whoever reads the file is told which package to uninstall."""
    source = SETTINGS.replace("towing: Towing", f"{name}: Towing")
    _install(site, "towing", "tow", source)
    variables = {**os.environ, "PYTHONPATH": f"{site}{os.pathsep}{_ROOT}"}
    done = subprocess.run(
        [sys.executable, "-c", "from aerodaas.config.model import LimitsConfig; LimitsConfig()"],
        env=variables,
        capture_output=True,
        text=True,
        check=False,
    )
    assert f"the extension 'tow' adds {name!r} to the settings of limits" in done.stderr


def test_no_test_of_the_core_imports_an_extension() -> None:
    """Their tests lie in `tests/extensions`, so that the others run without them."""
    found = []
    for path in (_ROOT / "tests").rglob("*.py"):
        if path.is_relative_to(_ROOT / "tests/extensions"):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [one.name for one in node.names] if isinstance(node, ast.Import) else []
            found += [str(path) for name in names if name.startswith("aerodaas.extensions.")]
    assert found == []


FLIGHT = """
from aerodaas import *

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2), Waypoint("b", 0, 2, 2)]))
drone.start_mission()
"""


IMPORTS = """
import importlib, pkgutil
import aerodaas
from aerodaas.config.extensions import extensions

programs = ("__main__", "templates", "apps")
for module in pkgutil.walk_packages(aerodaas.__path__, "aerodaas."):
    _, *folders = module.name.split(".")
    left_out = folders[0] == "extensions" and not set(folders[1:2]) <= set(extensions())
    if not set(folders) & set(programs) and not left_out:
        importlib.import_module(module.name)
"""


def _without(tmp_path: Path, left_out: list[str]) -> dict[str, str]:
    """A copy of the package without some extensions; the variables that have it imported."""
    copy = tmp_path / "copy"
    shutil.copytree(
        _ROOT / "aerodaas", copy / "aerodaas", ignore=shutil.ignore_patterns("__pycache__")
    )
    for name in left_out:
        shutil.rmtree(copy / "aerodaas/extensions" / name)
    return {**os.environ, "PYTHONPATH": str(copy)}


def _core_works(tmp_path: Path, left_out: list[str]) -> None:
    """Every module of the core is imported, its commands are listed, and a drone flies."""
    variables = _without(tmp_path, left_out)

    def run(*words: str) -> str:
        done = subprocess.run(
            [sys.executable, *words],
            cwd=tmp_path,
            env=variables,
            capture_output=True,
            text=True,
            check=False,
            timeout=240,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    names = run("-c", "from aerodaas.config.extensions import extensions; print(*extensions())")
    assert not set(left_out) & set(names.split())
    run("-c", IMPORTS)
    assert "run" in run("-m", "aerodaas", "--help")
    run("-m", "aerodaas", "init", "--vehicle", "simulated")
    (tmp_path / "app.py").write_text(FLIGHT)
    words = ("--speed", "max", "--no-view", "--record", str(tmp_path / "flights"))
    run("-m", "aerodaas", "run", "app.py", *words)
    (summary,) = (tmp_path / "flights").rglob("summary.txt")
    assert "2 of 2 waypoints" in summary.read_text()


def test_the_core_flies_without_any_extension(tmp_path: Path) -> None:
    """With all their folders deleted."""
    _core_works(tmp_path, _FOLDERS)


@pytest.mark.slow
@pytest.mark.parametrize("name", _FOLDERS)
def test_the_core_flies_without(tmp_path: Path, name: str) -> None:
    """With one extension's folder deleted."""
    _core_works(tmp_path, [name])

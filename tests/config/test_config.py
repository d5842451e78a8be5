"""The environment file: what it holds comes back, what it should not hold is refused by place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from core_settings import core_fields
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.config.checked import is_subclass
from aerodaas.config.model import EnvironmentConfig, LimitsConfig, validated
from aerodaas.config.overrides import located, overridden, parse_setting
from aerodaas.errors import ConfigError

ROOT = Path(__file__).parents[2]
names = st.from_regex(r"[A-Za-z][A-Za-z0-9_\-]{0,10}", fullmatch=True)
numbers = st.floats(0.01, 1e4)
limits = st.fixed_dictionaries(
    {"max_speed": st.floats(1.0, 1e4)},
    optional={"cruise_speed": st.floats(0.01, 1.0), "arrival_radius": numbers},
)
integers = st.integers(-(2**63) + 1, 2**63 - 1)
sensors = st.fixed_dictionaries(
    {"type": st.sampled_from(["camera", "odometry", "gps", "battery", "status"])},
    optional={
        "rate": st.floats(0.01, 1000.0),
        "settings": st.dictionaries(names, integers),
    },
)


@st.composite
def environments(draw: st.DrawFn) -> dict[str, Any]:
    """Contents of environment files, every id once."""
    ids = iter(draw(st.lists(names, min_size=8, max_size=8, unique=True)))
    robots = [
        {
            "id": next(ids),
            "limits": draw(limits),
            "sensors": [{"id": next(ids), **draw(sensors)} for _ in range(draw(st.integers(0, 2)))],
        }
        for _ in range(draw(st.integers(1, 2)))
    ]
    compute = draw(st.just("auto") | st.just([{"id": "here", "kind": "edge"}]))
    return {"robots": robots, "compute": compute, "simulation": {"seed": draw(st.integers(0, 9))}}


@given(environments())
def test_what_is_read_is_what_was_written(content: dict[str, Any]) -> None:
    """A file written from a configuration gives the same configuration."""
    config = validated(content, "here")
    again = validated(json.loads(config.model_dump_json(by_alias=True)), "there")
    assert again == config
    for told, robot in zip(content["robots"], config.robots, strict=True):
        assert robot.id == told["id"]
        assert {key: getattr(robot.limits, key) for key in told["limits"]} == told["limits"]


@given(environments(), st.floats(1.0, 1e4))
def test_a_setting_changes_what_it_names_and_nothing_else(
    content: dict[str, Any], speed: float
) -> None:
    """Laying a setting over and laying the old value over again is the identity."""
    config = validated(content, "here")
    robot = config.robots[0]
    name = f"{robot.id}.limits.max_speed"
    changed = overridden(config, {name: speed})
    assert changed.robots[0].limits.max_speed == speed
    assert overridden(changed, {name: robot.limits.max_speed}) == config
    assert overridden(config, {}) is config


@given(
    names,
    names,
    integers | st.booleans() | st.lists(integers) | st.none(),
)
def test_settings_are_json(owner: str, key: str, value: object) -> None:
    """`id.setting=value` comes apart as it was put together; what is no JSON is text."""
    assert parse_setting(f"{owner}.{key}={json.dumps(value)}") == (f"{owner}.{key}", value)
    assert parse_setting(f"{owner}.{key}=a/b=c d") == (f"{owner}.{key}", "a/b=c d")


@pytest.mark.parametrize("text", ["rate", "rate=1", "cam.rate", "=1", ""])
def test_settings_that_are_none(text: str) -> None:
    """The form is shown."""
    with pytest.raises(ConfigError, match=r"a setting is written id\.setting=value"):
        parse_setting(text)


@pytest.mark.parametrize("name", sorted(core_fields(LimitsConfig)))
def test_limits_are_never_negative_or_nan(name: str) -> None:
    """No limit of any name takes a number that would unbind it."""
    if name == "geofence":
        return
    for value in (-1.0, float("nan"), float("inf")):
        content = {"robots": [{"id": "d", "limits": {name: value}}]}
        with pytest.raises(ConfigError, match=f"robots.0.limits.{name}"):
            validated(content, "here")


@pytest.mark.parametrize(
    ("fence", "message"),
    [
        ({"polygon": [[0, 0], [1, 1]]}, "at least three corners"),
        ({"no_fly": [[[0, 0], [1, 1]]]}, "at least three corners"),
        ({"floor": 5, "ceiling": 5}, "ceiling must lie above its floor"),
    ],
)
def test_fences_that_are_none(fence: dict[str, Any], message: str) -> None:
    """The place and the reason are told."""
    with pytest.raises(ConfigError, match=rf"robots\.0\.limits\.geofence: .*{message}"):
        validated({"robots": [{"id": "d", "limits": {"geofence": fence}}]}, "here")


def test_ids_are_unique_among_the_sensors_of_a_robot() -> None:
    """Streams are named by both; what two robots carry may be called the same."""
    one = {"id": "a", "sensors": [{"id": "cam"}]}
    content = {"robots": [one, {**one, "id": "b"}], "sensors": [{"id": "cam"}]}
    names = [sensor.full_id for sensor in validated(content, "here").all_sensors()]
    assert names == ["a/cam", "b/cam", "cam"]
    with pytest.raises(ConfigError, match="more than one sensor of a is called cam"):
        validated({"robots": [{"id": "a", "sensors": [{"id": "cam"}] * 2}]}, "here")
    with pytest.raises(ConfigError, match="more than one environment sensor is called cam"):
        validated({"robots": [one], "sensors": [{"id": "cam"}] * 2}, "here")


def test_relative_paths_lead_where_the_file_lies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Beside the environment file first, then in the working directory; others stay as they are."""
    beside, here = tmp_path / "beside", tmp_path / "here"
    for folder in (beside / "both", here / "both", here / "only"):
        folder.mkdir(parents=True)
    monkeypatch.chdir(here)
    wanted = {"both": str(beside / "both"), "only": str(here / "only")}
    for path in ("both", "only", "nowhere", "rtsp://camera/1", "too long" * 50, str(here)):
        content = {"robots": [{"id": "d", "sensors": [{"id": "c", "settings": {"path": path}}]}]}
        settings = located(validated(content, "here"), beside).robots[0].sensors[0].settings
        assert settings["path"] == wanted.get(path, path)
        signed = {"robots": [{"id": "d", "settings": {"signing_key": path}}]}
        settings = located(validated(signed, "here"), beside).robots[0].settings
        assert settings["signing_key"] == wanted.get(path, path)


@pytest.mark.parametrize(
    "path", sorted((ROOT / "apps" / "environments").glob("*.json")), ids=lambda path: path.stem
)
def test_the_environments_of_our_apps_are_valid(path: Path) -> None:
    """Every file that ships can be loaded."""
    assert EnvironmentConfig.load(path).robots


@pytest.mark.parametrize(
    "task",
    [
        {"deadline": -5},
        {"deadline": 0},
        {"deadline": None},
        {"deadline": float("nan")},
        {"benefit": 0},
        {"edge_time": -1},
        {"cloud_cost": -1},
        {"qoe_share": 1.5},
    ],
)
def test_a_task_that_makes_no_sense_is_refused_by_its_place(task: dict[str, Any]) -> None:
    """The message names the analysis and the figure."""
    [name] = task
    content = {"robots": [{"id": "drone"}], "schedulers": {"tasks": {"model": task}}}
    with pytest.raises(ConfigError, match=rf"schedulers\.tasks\.model\.{name}"):
        validated(content, "here")


def test_a_task_without_a_deadline_has_a_second() -> None:
    """Missing figures have a default that a scheduler can work with."""
    content = {"robots": [{"id": "drone"}], "schedulers": {"tasks": {"model": {"benefit": 3}}}}
    assert validated(content, "here").schedulers.tasks["model"].deadline == 1000


@pytest.mark.parametrize(
    ("annotation", "found"),
    [(bool, True), (int, True), (str, False), (list[int], False), (int | None, False)],
)
def test_an_annotation_is_a_class_or_is_not(annotation: object, *, found: bool) -> None:
    """A parametrised list is none, although Python 3.10 takes it for one."""
    assert is_subclass(annotation, int) is found

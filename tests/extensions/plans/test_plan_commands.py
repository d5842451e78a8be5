"""`aerodaas plan`: what is in a plan, and its fence."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from aerodaas.cli.app import app
from aerodaas.config.model import GeofenceConfig
from aerodaas.errors import ConfigError

LINES = """QGC WPL 110
0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t488.0\t1
1\t0\t3\t178\t1\t4\t0\t0\t0\t0\t0\t1
2\t0\t3\t16\t2\t0\t0\t0\t47.001\t8.0\t20.0\t1
3\t0\t0\t16\t0\t0\t0\t0\t47.002\t8.0\t500.0\t1
4\t0\t3\t206\t25\t0\t0\t0\t0\t0\t0\t1
"""


@pytest.fixture
def plan(tmp_path: Path) -> Callable[..., Result]:
    """The command, in a folder with a plan."""
    (tmp_path / "a.waypoints").write_text(LINES)

    def run(*words: str) -> Result:
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(tmp_path)
            return CliRunner().invoke(app, ["plan", *words])

    return run


def test_a_plan_is_shown(plan: Callable[..., Result]) -> None:
    """Waypoints with place, height above home, speed and stay; then what is not done."""
    lines = plan("show", "a.waypoints").output.splitlines()
    shown = "item2 47.0010000, 8.0000000, 20 m above home, 4 m/s, hovers 2 s"
    assert " ".join(lines[0].split()) == shown
    assert lines[1].endswith("12 m above home, 4 m/s")
    assert lines[2].startswith("not done: item 4: DO_SET_CAM_TRIGG_DIST: no waypoint")
    assert lines[3] == "a.waypoints: waypoints: 2, not done: 1"
    higher = plan("show", "a.waypoints", "--home-altitude", "480").output
    assert "20 m above home, 4 m/s\n" in higher


def test_a_heading_is_shown(plan: Callable[..., Result], tmp_path: Path) -> None:
    """As the plan has it, in degrees clockwise from north."""
    item = {"type": "SimpleItem", "autoContinue": True, "command": 16, "frame": 3, "doJumpId": 1}
    item["params"] = [0, 0, 0, 270, 47.001, 8.0, 20]
    mission = {"items": [item], "plannedHomePosition": [47.0, 8.0, 488.0], "firmwareType": 12}
    (tmp_path / "a.plan").write_text(json.dumps({"mission": mission}))
    line, *_ = plan("show", "a.plan").output.splitlines()
    assert line.endswith("20 m above home, heading 270 degrees")


def test_what_is_photographed_is_shown(plan: Callable[..., Result], tmp_path: Path) -> None:
    """Triggers, single pictures, the gimbal, what is looked at, and video."""
    rows = [
        *("2 205 -90 0 0 0 0 0 2", "3 16 0 0 0 0 47.001 8 20", "2 2000 0 0 1 0 0 0 0"),
        "2 2500 0 0 0 0 0 0 0",
        *("2 206 5 0 1 0 0 0 0", "3 195 0 0 0 0 47.1 8.1 3", "3 16 0 0 0 0 47.002 8 20"),
        "2 2501 0 0 0 0 0 0 0",
    ]
    fields = [f"{n} 0 {row} 1".replace(" ", "\t") for n, row in enumerate(rows, start=1)]
    path = tmp_path / "b.waypoints"
    path.write_text("\n".join([*LINES.splitlines()[:2], *fields]))
    first, second, *_ = plan("show", "b.waypoints").output.splitlines()
    assert first.endswith("gimbal at pitch -90, yaw 0 degrees, a picture, video begins")
    looks = "a picture every 5 m on the way, looks at 47.1000000, 8.1000000, 3 m"
    assert second.endswith(f"{looks}, video ends")


def test_a_fence_is_written_for_an_environment(plan: Callable[..., Result], tmp_path: Path) -> None:
    """In metres of the plan's home, or of the given."""
    assert "has no geofence" in str(plan("fence", "a.waypoints").exception)
    corners = [[47.0, 8.0], [47.0, 8.001], [47.001, 8.001]]
    fence = {"version": 2, "polygons": [{"inclusion": True, "polygon": corners}], "circles": []}
    mission = {"items": [], "plannedHomePosition": [47.0, 8.0, None]}
    file = tmp_path / "a.plan"
    file.write_text(json.dumps({"geoFence": fence, "mission": mission}))
    printed = json.loads(plan("fence", "a.plan").output)
    assert GeofenceConfig.model_validate(printed).polygon[2] == pytest.approx(
        (76.0, 111.2), abs=0.1
    )
    moved = json.loads(plan("fence", "a.plan", "--home", "47.001,8.001").output)
    assert moved["polygon"][2] == pytest.approx([0, 0])
    for wrong in ("47", "47,x", "47,8,9", "nan,8", "97,8"):
        assert isinstance(plan("fence", "a.plan", "--home", wrong).exception, ConfigError)
    file.write_text(json.dumps({"geoFence": fence, "mission": {"items": []}}))
    assert "does not know its home: give --home" in str(plan("fence", "a.plan").exception)

"""An application's graph as a flowchart."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import exit_code

from aerodaas import Environment, MonitoringAnalytics
from aerodaas.cli.flying.application import build_application
from aerodaas.config.options import RunOptions
from aerodaas.dataflow import graph as module
from aerodaas.dataflow.drawing import mermaid

RESCUE = """flowchart LR
    subgraph g0["sensors of tello"]
        n0(["tello/cam1"])
        n3(["tello/odom"])
    end
    subgraph g1["edge"]
        n1["tello/vip_detection<br/>VipDetectionAnalytics"]
        n2["tello/vip_follow<br/>VipFollowAnalytics"]
        n4["tello/monitoring<br/>MonitoringAnalytics"]
    end
    r0{{"tello flies"}}
    n0 -->|"Frame"| n1
    n1 -->|"Detections"| n2
    n3 -->|"Odometry"| n4
    n4 -.->|"end_mission"| r0
    w0[/"4 waypoints"/] ==> r0
    n2 ==>|navigates| r0
"""


@pytest.fixture
def env(monkeypatch: pytest.MonkeyPatch) -> Environment:
    """The farm, with its drone."""
    monkeypatch.chdir(Path(__file__).parents[2] / "apps")
    return Environment("environments/farm.json")


def test_search_and_rescue_is_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Sensors, analyses where they run, streams, a trigger, waypoints; printed or in a file."""
    for words in (["search_and_rescue"], ["search_and_rescue", "-o", str(tmp_path / "a.mmd")]):
        assert exit_code("compile", "--graph", *words) == 0
    assert capsys.readouterr().out == RESCUE
    assert (tmp_path / "a.mmd").read_text() == RESCUE


def test_the_documentation_shows_what_is_drawn() -> None:
    """The picture of Situation Awareness is the one that the command draws."""
    root = Path(__file__).parents[2]
    application = root / "apps" / "situation_awareness.py"
    options = RunOptions(application=application, view=False)
    drawn = mermaid(build_application(application, [], options).graph)
    assert f"```mermaid\n{drawn}```" in (root / "docs" / "getting-started.md").read_text()


def test_what_sleeps_and_where_nothing_is_deployed_is_said(env: Environment) -> None:
    """A trigger wakes a dormant analysis; one that is not deployed runs beside the drone."""
    drone = env.get_robot_by_id("quadrotor_base")
    odometry = drone.get_sensor_by_id("odom").get_data_stream()
    asleep = MonitoringAnalytics(["height"])
    asleep.analyse(odometry)
    MonitoringAnalytics(["battery"]).trigger(asleep).analyse(odometry)
    lines = mermaid(env.graph).splitlines()
    assert '    subgraph g1["beside the drone"]' in lines
    assert "    n2 -.->|wakes| n1" in lines
    assert [line.split("[")[0].strip() for line in lines if "until it is triggered" in line] == [
        "n1"
    ]


def test_an_environment_draws_itself_in_a_notebook(env: Environment) -> None:
    """Even before anything was asked of it."""
    bundle = env._repr_mimebundle_(include=None, exclude=None)
    assert bundle["text/vnd.mermaid"] == "flowchart LR\n"
    assert "Environment" in bundle["text/plain"]


def test_an_example_in_the_package_is_an_application(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Where it is installed, its folder is the package's; its lines are named all the same."""
    monkeypatch.setattr(module, "_OURS", (*module._OURS, tmp_path))
    monkeypatch.setattr(module, "_APPLICATIONS", tmp_path / "apps")
    names = {"line": module.application_line}
    for file in (tmp_path / "apps" / "survey.py", tmp_path / "inner.py"):
        exec(compile("\nfound = line()", str(file), "exec"), names)  # noqa: S102 - our own line
        names[file.stem] = names.pop("found")
    assert str(names["survey"]).startswith("survey.py:2")
    assert str(names["inner"]).startswith("test_drawing.py:")

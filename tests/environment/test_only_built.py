"""An application that is only built runs nothing that belongs to its flight."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from command_line import exit_code
from flying import FLAT, robot

from aerodaas.environment.document.flying import compile_application
from aerodaas.errors import GraphError

APPLICATION = """
from pathlib import Path
from aerodaas import AeroListData, Analytics, Environment, Waypoint

def mark(what):
    with (Path(__file__).parent / "marks").open("a") as file:
        file.write(what + " ")

class Marking(Analytics[float]):
    def __init__(self):
        mark("constructor")

    def open(self):
        mark("open")

    def process(self, item, context):
        mark("process")

    def close(self):
        mark("close")

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
odometry = drone.get_sensor_by_id("odom").get_data_stream()
Marking().deploy(env.get_compute_resource_by_id("edge")).analyse(odometry)
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2)]))
{hooks}
try:
    {start}
    mark("after")
except Exception:
    mark("failure")
mark("later")
"""
HOOKS = """
drone.on_start(lambda: mark("on_start"))
drone.on_end(lambda: mark("on_end"))
drone.get_sensor_by_id("odom").subscribe(lambda item: mark("callback"))
"""
COMMANDS = {"check": ["--no-connect"], "compile": ["-o", "mission.json"], "compile --graph": []}


def built(
    monkeypatch: pytest.MonkeyPatch, command: str, start: str, hooks: str = HOOKS
) -> tuple[int, list[str]]:
    """Exit code of a command that builds the application here, and what the application ran."""
    Path("environment.json").write_text(
        json.dumps({**FLAT, "robots": [robot(sensors=[{"id": "odom", "type": "odometry"}])]})
    )
    Path("app.py").write_text(APPLICATION.format(hooks=hooks, start=start))
    Path("marks").write_text("")
    monkeypatch.setattr(sys, "path", list(sys.path))
    code = exit_code(*command.split(), "app.py", *COMMANDS[command])
    return code, Path("marks").read_text().split()


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    "start",
    [
        'drone.start_mission(lambda: mark("hook"))',
        "env.start_mission()",
        'env.start_mission(lambda: mark("hook"), wait=False); env.wait()',
        "env.launch()",
    ],
)
@pytest.mark.parametrize(
    ("command", "opens"), [("check", ["open", "close"]), ("compile --graph", [])]
)
def test_what_belongs_to_the_flight_does_not_run(
    monkeypatch: pytest.MonkeyPatch, command: str, opens: list[str], start: str
) -> None:
    """No hook, no callback, nothing after the flight; only a check opens analyses, to try them."""
    code, ran = built(monkeypatch, command, start)
    failure = ["failure", "later"] if "launch" in start else []
    assert (code, ran) == (0, ["constructor", *failure, *opens])
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    "hooks",
    ['drone.on_start(lambda: mark("on_start"))', 'drone.on_end(lambda: mark("on_end"))', ""],
)
def test_a_document_is_refused_without_running_a_hook(
    monkeypatch: pytest.MonkeyPatch, hooks: str
) -> None:
    """It cannot hold one; that given to `start_mission` included."""
    start = "drone.start_mission()" if hooks else 'drone.start_mission(lambda: mark("hook"))'
    code, ran = built(monkeypatch, "compile", start, hooks)
    assert (code, ran) == (2, ["constructor"])
    with pytest.raises(GraphError, match="no hooks of on_start, on_end or start_mission"):
        compile_application(Path("app.py"), [])

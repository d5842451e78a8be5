"""`aerodaas check` tries all that a flight needs, and moves nothing."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from command_line import ran
from flying import FLAT, robot

from aerodaas.cli import doctor
from aerodaas.cli.flying import check

PARTS = """
import math
from dataclasses import replace
from aerodaas import *
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.messages.odometry import Battery

class Mine(Analytics[int]):
    accepts = (Odometry,)
    produces = int

    def __init__(self, broken=False):
        self.broken = broken

    def open(self):
        if self.broken:
            raise FileNotFoundError("no weights in [/here]")

    def process(self, item, context):
        return 1

class Careful(SimulatedVehicle):
    closed = moved = 0

    def preflight(self):
        return ["the propellers are off"]

    def take_off(self, height):
        Careful.moved += 1

    def close(self):
        Careful.closed += 1
        super().close()

class Slow(SimulatedVehicle):
    advance_to = None  # its time is its own
    reads = asked = 0

    def read(self):
        Slow.reads += 1
        state = super().read()
        return state if Slow.reads > 2 else replace(state, battery=Battery(math.nan))

    def preflight(self):
        Slow.asked += 1
        return super().preflight()

class Uncharged(SimulatedVehicle):
    advance_to = None

    def read(self):
        return replace(super().read(), battery=Battery(math.nan))

class Blind:
    model, finished, skipped = None, False, 0
    def __init__(self, sensor, environment): ...
    def open(self): ...
    def capture(self, stamp, pose): ...
    def close(self): ...
"""
APPLICATION = """
from aerodaas import *
from check_parts import Mine

env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
odometry = drone.get_sensor_by_id("odom").get_data_stream()
drone.get_sensor_by_id("cam").get_data_stream()
Mine({broken}).deploy(env.get_compute_resource_by_id("edge")).analyse(odometry)
drone.navigate(AeroListData([Waypoint("a", 2, 0, 2)]))
drone.start_mission()
"""


class Checked:
    """Runs `aerodaas check` in a folder of its own."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        capture: pytest.CaptureFixture[str],
    ) -> None:
        self._folder, self._patch, self._capture = folder, monkeypatch, capture

    def __call__(
        self, *words: str, broken: bool = False, more: str = "", **settings: str
    ) -> tuple[int, str]:
        """Exit code and output, with these drivers of drone and camera.

        With `more`, the application goes on after it has started the mission.
        """
        camera = {"id": "cam", "type": "camera", "settings": {"width": 64, "height": 36}}
        sensors = [{"id": "odom", "type": "odometry"}, {**camera, "driver": settings.get("camera")}]
        drone = {**robot(sensors=sensors), "driver": settings.get("vehicle", "simulated")}
        (self._folder / "environment.json").write_text(json.dumps({**FLAT, "robots": [drone]}))
        text = APPLICATION.replace("{broken}", str(broken))
        if more:
            text = text.replace("start_mission()", f"start_mission(wait=False)\n{more}")
        (self._folder / "app.py").write_text(text)
        (self._folder / "check_parts.py").write_text(PARTS)
        sys.modules.pop("check_parts", None)
        self._patch.setattr(sys, "path", list(sys.path))
        code, out, said = ran(self._capture, "check", "app.py", *words)
        return code, " ".join((out + said).split())


@pytest.fixture
def checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Checked:
    """The command, with little patience."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(check, "_CONNECTING", 0.3)
    monkeypatch.setattr(check, "_FIRST_PICTURE", 0.3)
    return Checked(tmp_path, monkeypatch, capsys)


def test_all_is_well(checked: Checked) -> None:
    """Each part is named with what it answered."""
    code, told = checked()
    assert code == 0, told
    assert "ok drone/mine Mine on edge opens" in told
    assert "ok drone simulated answers: grounded, battery 100 %" in told
    assert "ok drone/cam simulated gives pictures of 64 x 36" in told
    assert "flies here alone: Mine is the application's own code" in told


def test_what_fails_is_named_and_the_rest_is_tried(checked: Checked) -> None:
    """A model that is not there, a camera without pictures; the drone is asked all the same."""
    code, told = checked(broken=True, camera="check_parts:Blind")
    assert code == 1
    assert "no drone/mine FileNotFoundError: no weights in [/here]" in told
    assert "ok drone simulated answers" in told
    assert "no drone/cam check_parts:Blind gives no picture within 0 s" in told


def test_the_doctor_names_the_extra_that_is_missing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With its brackets; one does well without."""
    monkeypatch.setattr(doctor, "_PACKAGES", {"pyvrp": "no_such_module"})
    assert doctor.show_findings("packages", doctor._packages())
    assert "pip install 'aerodaas[routing]'" in " ".join(capsys.readouterr().out.split())
    monkeypatch.setattr(doctor, "_PACKAGES", {"ray": "no_such_module"})
    assert not doctor.show_findings("packages", doctor._packages())


def test_a_vehicle_that_would_not_take_off_is_told_and_let_go(checked: Checked) -> None:
    """It is asked and closed, and never moved."""
    code, told = checked(vehicle="check_parts:Careful", camera="simulated")
    assert code == 1
    assert "check_parts:Careful would not take off: the propellers are off" in told
    careful = sys.modules["check_parts"].Careful
    assert (careful.closed, careful.moved) == (1, 0)


def test_a_vehicle_is_judged_by_what_it_says_in_the_end(
    checked: Checked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some is told late; until then it is read, and once it is judged."""
    monkeypatch.setattr("aerodaas.cli.flying.preflight._SETTLING", 0.5)
    code, told = checked(vehicle="check_parts:Slow", camera="simulated")
    assert code == 0, told
    assert "ok drone check_parts:Slow answers: grounded, battery 100 %" in told
    slow = sys.modules["check_parts"].Slow
    assert slow.asked == 1
    assert slow.reads > 4


def test_a_charge_that_no_vehicle_tells_is_called_unknown(
    checked: Checked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is no number."""
    monkeypatch.setattr("aerodaas.cli.flying.preflight._SETTLING", 0.1)
    _, told = checked(vehicle="check_parts:Uncharged", camera="simulated")
    assert "check_parts:Uncharged answers: grounded, battery unknown" in told


@pytest.mark.parametrize(
    ("more", "portable"),
    [
        ("drone.wait()", True),
        ("env.wait()", True),
        ("print(odometry.get_data(timeout=5))", False),
        ("drone.pause_mission()\ndrone.wait()", False),
        ("env.wait()\nprint(env.run.recording)", True),
        ("print(env.run.recording)", False),
        ("try: drone.end_mission()\nexcept Exception: pass", False),
    ],
)
def test_an_application_that_goes_on_in_flight_is_checked_and_not_flown(
    checked: Checked, more: str, *, portable: bool
) -> None:
    """It ends where it wants something of the flight, which no document can hold."""
    code, told = checked(vehicle="check_parts:Careful", camera="simulated", more=more)
    assert code == 1
    assert "check_parts:Careful would not take off: the propellers are off" in told
    assert sys.modules["check_parts"].Careful.moved == 0
    assert not Path("runs").exists()
    assert ("only `aerodaas run` flies such an application" in told) is not portable


def test_a_vehicle_that_does_not_answer_is_told(checked: Checked) -> None:
    """With the remedy of its driver; unless nothing shall be connected."""
    code, told = checked(
        "--set", "drone.url=udpin:127.0.0.1:0", vehicle="mavlink", camera="simulated"
    )
    assert code == 1
    assert "no HEARTBEAT" in told
    words = ("--no-connect", "--set", "drone.url=udpin:127.0.0.1:0")
    code, told = checked(*words, vehicle="mavlink", camera="simulated")
    assert code == 0, told
    assert "mavlink" not in told


def test_a_graph_that_cannot_fly_is_an_error(checked: Checked) -> None:
    """As for `aerodaas run`: exit code 2, the place and the remedy."""
    code, told = checked("--set", "drone.wings=2")
    assert code == 2
    assert "wings" in told

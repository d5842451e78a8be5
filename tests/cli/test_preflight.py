"""`aerodaas check --robot` prints a robot's health as one list, and moves nothing."""

from __future__ import annotations

import json
import socket
from pathlib import Path
from typing import Any

import pytest
from command_line import ran

from tools.tello_vehicle import EmulatedTello

DRONE: dict[str, Any] = {"id": "drone"}


class Looked:
    """Runs `aerodaas check --robot` in a folder of its own."""

    def __init__(self, folder: Path, capture: pytest.CaptureFixture[str]) -> None:
        self._folder, self._capture = folder, capture

    def __call__(
        self,
        *words: str,
        robot: dict[str, Any] = DRONE,
        **environment: Any,  # noqa: ANN401
    ) -> tuple[int, str]:
        """Exit code and output."""
        content = {"robots": [robot], **environment}
        (self._folder / "environment.json").write_text(json.dumps(content))
        code, out, said = ran(self._capture, "check", "environment.json", "--robot", *words)
        return code, out + said


@pytest.fixture
def look(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Looked:
    """The command, on a wide terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    return Looked(tmp_path, capsys)


def rows(told: str) -> dict[str, dict[str, str]]:
    """The items of the JSON by name."""
    return {item["name"]: item for item in json.loads(told)["items"]}


def test_a_table_for_people(look: Looked) -> None:
    """Value, bound, verdict; what a simulation does not have is unknown."""
    code, told = look("drone")
    assert code == 0, told
    lines = {line.split()[0]: " ".join(line.split()) for line in told.splitlines() if line}
    assert lines["battery"] == "battery 100%, 16.8 V more than 25% good"
    assert lines["wind"] == "wind 0.0 m/s at most 10 good"
    assert lines["compass"] == "compass not known at most 0.8 unknown"


def test_a_vehicle_may_speak_in_brackets(
    look: Looked, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its words are shown as they are."""
    (tmp_path / "blunt_vehicle.py").write_text(
        "from aerodaas.drivers.simulated import SimulatedVehicle\n"
        "class Blunt(SimulatedVehicle):\n"
        "    def preflight(self): return ['[/arm] refused [by me]']\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    code, told = look("drone", robot={**DRONE, "driver": "blunt_vehicle:Blunt"})
    assert code == 1
    assert "[/arm] refused [by me]" in told


def test_json_for_programs(look: Looked) -> None:
    """The same, with an answer whether it is ready; policy may come by `--set`."""
    strong = {"simulation": {"wind": [12.0, 0.0, 0.0]}}
    code, told = look("drone", "--json", **strong)
    assert (code, json.loads(told)["ready"]) == (0, True)
    assert rows(told)["wind"]["verdict"] == "warning"
    code, told = look("drone", "--json", "--set", "drone.preflight.wind=refuse", **strong)
    assert (code, json.loads(told)["ready"]) == (1, False)
    wind = rows(told)["wind"]
    assert (wind["value"], wind["bound"]) == ("12.0 m/s", "at most 10")
    assert (wind["verdict"], wind["remedy"]) == ("refused", "wait for less wind")


def test_battery_and_fence_refuse(look: Looked) -> None:
    """Whatever the policy."""
    fence = {"geofence": {"polygon": [[5, 5], [9, 5], [9, 9]]}}
    low = {**DRONE, "settings": {"battery": 0.2}, "limits": fence}
    code, told = look("drone", "--json", robot=low)
    refused = {name for name, item in rows(told).items() if item["verdict"] == "refused"}
    assert code == 1
    assert {"battery", "fence"} <= refused


@pytest.mark.parametrize(
    ("words", "robot", "said"),
    [
        (("dron",), DRONE, "drone"),
        (("drone",), {**DRONE, "preflight": {"wind": "panic"}}, "preflight.wind"),
        (("drone",), {**DRONE, "preflight": {"winds": "warn"}}, "winds"),
        (("drone",), {**DRONE, "driver": "mavlink", "settings": {"url": "udp"}}, "udpin:HOST"),
    ],
)
def test_what_is_wrong_is_named(
    look: Looked, words: tuple[str, ...], robot: dict[str, Any], said: str
) -> None:
    """A robot, a file, a policy, a setting."""
    code, told = look(*words, robot=robot)
    assert code != 0
    assert told.startswith("error")
    assert said in told


def test_a_tello_tells_what_it_knows(look: Looked) -> None:
    """Its charge and its link; where it ends without us; nothing of what it does not measure."""
    with EmulatedTello() as tello:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            state_port = probe.getsockname()[1]
        settings = {"address": "127.0.0.1", "command_port": tello.port, "state_port": state_port}
        robot = {**DRONE, "driver": "tello", "settings": settings}
        code, told = look("drone", "--json", robot=robot)
    items = rows(told)
    assert code == 0, told
    assert items["battery"]["verdict"] == items["link"]["verdict"] == "good"
    assert items["fallback"]["verdict"] == "warning"
    assert {items[name]["verdict"] for name in ("gps", "cells", "wind")} == {"unknown"}

"""The pages for people who come from elsewhere: our code flies, and messages are the product's."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from flying import Flyer

from aerodaas.config.environment_choices import EnvironmentChoices, vehicle_kinds
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight, RobotFlight

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "coming-from.md").read_text(encoding="utf-8")
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE, re.MULTILINE | re.DOTALL))


def fly(section: str, flyer: Flyer, monkeypatch: pytest.MonkeyPatch) -> RobotFlight:
    """Fly our block of a section with the environment that `aerodaas init` writes."""
    (code,) = re.findall(r"```python\n(.*?)```", SECTIONS[section], re.DOTALL)
    home = {"latitude": 13.0166, "longitude": 77.5695, "altitude": 920.0}
    environment = EnvironmentChoices("simulated").document("environment.schema.json", flyer.folder)
    flyer.write({**environment, "home": home})
    monkeypatch.chdir(flyer.folder)
    with flyer.options():
        exec(code, {"__name__": "__main__"})  # noqa: S102 - our own page
    with Recording.open(flyer.folder / "flight" / "flight.mcap") as recording:
        flight = RecordedFlight.read(recording)
    assert flight.robots["drone"].outcome.startswith("landed")
    assert not flight.alerts
    return flight.robots["drone"]


def test_each_section_shows_both() -> None:
    """Their code, ours, and a table of what is called what."""
    assert set(SECTIONS) == {"MAVSDK", "DroneKit", "djitellopy", "Aerostack2", "ROS 2"}
    for text in SECTIONS.values():
        assert len(re.findall(r"^```py$", text, re.MULTILINE)) == 1
        assert len(re.findall(r"^```python$", text, re.MULTILINE)) == 1
        assert len(re.findall(r"^\| ", text, re.MULTILINE)) > 5


@pytest.mark.slow
@pytest.mark.parametrize("section", ["MAVSDK", "DroneKit", "djitellopy", "Aerostack2", "ROS 2"])
def test_our_code_flies(
    section: str,
    flyer: Flyer,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """As printed, to where theirs flies."""
    drone = fly(section, flyer, monkeypatch)
    visited = {
        "MAVSDK": ("corner",),
        "DroneKit": ("field",),
        "djitellopy": ("ahead",),
        "Aerostack2": ("wp0", "wp1", "wp2"),
        "ROS 2": (),
    }
    assert drone.visited == visited[section]
    east, north = drone.position[:, 0].max(), drone.position[:, 1].max()
    if section == "MAVSDK":
        assert (east, north) == (pytest.approx(4, abs=0.5), pytest.approx(8, abs=0.5))
    if section == "DroneKit":
        assert (east, north) == (pytest.approx(5.4, abs=0.6), pytest.approx(7.7, abs=0.6))
    if section == "djitellopy":
        assert re.search(r"^\d+%$", capsys.readouterr().out, re.MULTILINE)
        assert (flyer.folder / "picture.png").stat().st_size > 10_000
    if section == "ROS 2":
        assert 1.9 < east < 3.5


def test_the_environment_is_what_init_writes_for_each_vehicle() -> None:
    """Sensors, drone and edge have the names that the blocks use."""
    for vehicle, kind in vehicle_kinds().items():
        cameras = None if kind.camera is not None else ["rtsp://127.0.0.1/a"]
        document = EnvironmentChoices(vehicle, cameras=cameras).document("s", Path())
        (robot,) = document["robots"]
        assert {one["id"] for one in robot["sensors"]} == {"camera", "odometry", "battery"}
        assert (robot["id"], document["compute"][0]["id"]) == ("drone", "edge")


def templates() -> Iterator[str]:
    """Every text of the product's sources but docstrings, what is filled in as `…`."""
    for folder in ("aerodaas", "actors", "schedulers"):
        for path in (ROOT / folder).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            nodes = list(ast.walk(tree))
            explained = {id(node.value) for node in nodes if isinstance(node, ast.Expr)}
            for node in nodes:
                if isinstance(node, ast.Constant) and isinstance(node.value, str):
                    if id(node) not in explained:
                        yield node.value
                elif isinstance(node, ast.JoinedStr):
                    yield "".join(
                        str(one.value) if isinstance(one, ast.Constant) else "…"
                        for one in node.values
                    )


def test_messages_of_the_troubleshooting_page_are_the_products() -> None:
    """Each quoted message is in the source, word for word but for what `…` stands for."""
    page = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    quoted = re.findall(r"^\| `([^`]+?)` \| \S", page, re.MULTILINE)
    assert len(quoted) == len(re.findall(r"^\| `", page, re.MULTILINE)) > 30
    known = list(templates())
    for message in quoted:
        words = ".*".join(map(re.escape, message.split("…")))
        said = re.compile(f"{words}", re.DOTALL)
        assert len(message.replace("…", "").strip()) > 10, message
        assert any(said.search(text) for text in known), message

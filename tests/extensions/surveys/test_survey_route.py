"""Surveys that are drawn on the map of one's own flight."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from hovering import Run, ask, watched_console

from aerodaas.errors import SchedulerError
from aerodaas.extensions.surveys import service
from aerodaas.service.own.server import FlightServer

pytestmark = pytest.mark.wall_clock

FIELD = [[0, 0], [20, 0], [20, 10], [0, 10]]
SURVEY = {"robot": "drone", "area": FIELD, "height": 4, "width": 5, "name": "s1"}


@pytest.fixture(scope="module")
def watched() -> Iterator[tuple[FlightServer, Run]]:
    """A drone on its way to one waypoint, whose status is known."""
    with watched_console() as both:
        yield both


@pytest.fixture
def flying(watched: tuple[FlightServer, Run]) -> tuple[FlightServer, Run]:
    """The same, and it was told nothing yet."""
    watched[1].commands.clear()
    watched[1].notes.clear()
    return watched


def test_a_viewer_plans_none(flying: tuple[FlightServer, Run]) -> None:
    """Planning takes a core, so that it needs the role of a pilot."""
    address = flying[0].address(viewer=True)
    assert ask(address, "/v1/missions/own/survey", SURVEY)[0] == 403


def test_a_survey_is_planned_and_not_flown(flying: tuple[FlightServer, Run]) -> None:
    """Waypoints, figures and the battery's share, from the waypoint that comes before."""
    server, run = flying
    status, _, answer = ask(server.address(), "/v1/missions/own/survey", SURVEY)
    assert status == 200
    assert [one["id"] for one in answer["waypoints"][:2]] == ["s1-1", "s1-2"]
    assert (answer["sweeps"], answer["start"]) == (3, [3, 4, 2])
    assert 40 < answer["length"] < 80
    assert answer["available"] == pytest.approx(0.5 - 0.12)
    assert 0 < answer["battery"] < 0.2
    by_camera = {**SURVEY, "width": None, "field_of_view": 2 * 0.5586}
    wide = ask(server.address(), "/v1/missions/own/survey", by_camera)[2]
    assert wide["width"] == pytest.approx(5, abs=0.01)
    assert not run.commands
    visit = {"robot": "drone", "waypoints": answer["waypoints"]}
    assert ask(server.address(), "/v1/missions/own/navigation", visit)[0] == 200
    assert len(run.commands) == 1


@pytest.fixture(scope="module")
def mapper() -> Iterator[FlightServer]:
    """The console of a drone with a camera on a gimbal, and one that looks ahead."""
    hung = {"gimbal": {}, "width": 4000, "height": 3000, "horizontal_fov": 60, "photo_interval": 2}
    sensors = [
        {"id": "map", "type": "camera", "settings": hung},
        {"id": "front", "type": "camera", "driver": "tello"},
    ]
    with watched_console(robots=[{"id": "drone", "sensors": sensors}]) as (server, _):
        yield server


def test_a_survey_is_planned_by_its_camera(mapper: FlightServer) -> None:
    """Height by resolution, lines and pictures by overlap, and a warning where it is too slow."""
    wanted = {
        **SURVEY,
        "height": None,
        "width": None,
        "camera": "map",
        "overlap": 0.6,
        "front_overlap": 0.8,
        "ground_resolution": 0.002,
    }
    status, _, answer = ask(mapper.address(), "/v1/missions/own/survey", wanted)
    assert status == 200
    assert answer["height"] == pytest.approx(8 / (2 * math.tan(math.radians(30))))
    assert answer["width"] == pytest.approx(8.0)
    photos = answer["photos"]
    assert photos["resolution"] == pytest.approx(0.002)
    assert photos["line_spacing"] == pytest.approx(0.4 * 8.0)
    assert 0.9 * 1.2 < photos["spacing"] <= 1.2
    assert photos["interval"] == pytest.approx(photos["spacing"])
    assert "needs 2 s for one" in photos["warning"]
    actions = [{one["type"]: one for one in stop["actions"]} for stop in answer["waypoints"]]
    triggers = [one.get("trigger_photos", {}).get("distance") for one in actions]
    assert sum(one is not None for one in triggers) == answer["sweeps"]
    assert {one["aim_gimbal"]["pitch"] for one in actions} == {-math.pi / 2}
    assert len(photos["places"]) > 15 * answer["sweeps"]
    assert ask(mapper.address(), "/v1/missions/own/survey", SURVEY)[2]["photos"] is None


@pytest.mark.parametrize(
    ("changes", "status", "text"),
    [
        ({"camera": "front"}, 422, "looks 0 degrees down and not straight down: mount it so"),
        ({"camera": "ghost"}, 422, "no camera 'ghost'; it has map, front"),
        ({"width": 4}, 422, "give either"),
        ({"height": None}, 422, "give either a height or"),
        ({"ground_resolution": 0.01}, 422, "give either a height or"),
        ({"height": None, "ground_resolution": 0}, 422, "ground_resolution"),
        ({"front_overlap": 1}, 422, "front_overlap"),
        ({"camera": None, "width": 4, "height": None, "ground_resolution": 1}, 422, "the camera"),
        ({"height": None, "ground_resolution": 0.05}, 422, "above the ceiling"),
    ],
)
def test_a_camera_that_cannot_survey_is_refused(
    mapper: FlightServer, changes: dict[str, object], status: int, text: str
) -> None:
    """With the reason, and the remedy."""
    wanted = {"robot": "drone", "area": FIELD, "height": 4, "camera": "map", **changes}
    found = ask(mapper.address(), "/v1/missions/own/survey", wanted)
    assert (found[0], text in found[2]["text"]) == (status, True), found[2]


@pytest.mark.parametrize(
    ("changes", "status", "text"),
    [
        ({"area": FIELD[:2]}, 422, "area"),
        ({"area": [[0, 0]] * 31}, 422, "area"),
        ({"area": [[0, 0], [20, 20], [20, 0], [0, 20]]}, 422, "crosses itself"),
        ({"area": [[0, 0], [1e307, 0], [0, 1]]}, 422, "area"),
        ({"height": -1}, 422, "height"),
        ({"height": 500}, 422, "above the ceiling"),
        ({"width": None}, 422, "give either"),
        ({"field_of_view": 1}, 422, "give either"),
        ({"width": 0.001}, 422, "more than 200 strips"),
        ({"overlap": 1}, 422, "overlap"),
        ({"angle": "north"}, 422, "angle"),
        ({"speed": 0}, 422, "speed"),
        ({"robot": "ghost"}, 409, "ghost does not fly"),
        ({"extra": 1}, 422, "extra"),
    ],
)
def test_surveys_are_refused_with_their_reason(
    flying: tuple[FlightServer, Run], changes: dict[str, object], status: int, text: str
) -> None:
    """What is malformed, and what cannot be flown."""
    found = ask(flying[0].address(), "/v1/missions/own/survey", {**SURVEY, **changes})
    assert (found[0], text in found[2]["text"]) == (status, True), found[2]


def test_surveys_wait_for_few_others(
    flying: tuple[FlightServer, Run], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each that waits has a thread, without which no command would come through."""
    free, begun = threading.Event(), threading.Event()

    def plan(*_: object, **__: object) -> None:
        begun.set()
        assert free.wait(20)
        raise SchedulerError("as good as planned")

    monkeypatch.setattr(service, "planned_survey", plan)
    server, run = flying
    pause = {"robot": "drone", "command": "pause"}
    with ThreadPoolExecutor(60) as pool:
        asked = [
            pool.submit(ask, server.address(), "/v1/missions/own/survey", SURVEY) for _ in range(50)
        ]
        assert begun.wait(20)
        assert ask(server.address(), "/v1/missions/own/commands", pause)[0] == 200
        end = time.monotonic() + 20
        while sum(one.done() for one in asked) < 50 - service._MOST_ASKED:
            assert time.monotonic() < end
            time.sleep(0.01)
        free.set()
        told = [one.result()[2]["text"] for one in asked]
    assert len(run.commands) == 1
    assert told.count("as good as planned") == service._MOST_ASKED
    assert sum("other surveys are being planned" in one for one in told) == 50 - service._MOST_ASKED

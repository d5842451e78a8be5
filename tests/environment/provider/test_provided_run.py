"""Flights of applications by a provider, as the application meets them."""

from __future__ import annotations

import hashlib
import json
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from provider_stub import CATALOGUE, MISSION, TOKEN, Stub, mission

from aerodaas import AeroNavigation, Environment, NavigationType, OrderedScheduler, Waypoint
from aerodaas.analytics import MonitoringAnalytics, VipDetectionAnalytics
from aerodaas.analytics.models import DETECTOR
from aerodaas.analytics.wire_items import pack
from aerodaas.config.options import ProviderOptions, RunOptions, current_options
from aerodaas.environment.provider import client as client_module
from aerodaas.environment.provider import exchange, follower
from aerodaas.errors import (
    ConfigError,
    GraphError,
    InvalidWaypointError,
    MissionError,
    RecordingError,
    SourceError,
    UnknownIdError,
)
from aerodaas.mission.commands import AddNavigation, Answer
from aerodaas.protocol.schemas import MissionPhase, NavigationIn, VerdictOut


@pytest.fixture(autouse=True)
def _quiet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No terminal view, no plots; recordings go to the test's own folder."""
    current_options.set(RunOptions(view=False, record=tmp_path / "out"))
    monkeypatch.setattr("aerodaas.terminal.console.show_results", lambda *_, **__: None)
    monkeypatch.setattr(exchange, "_FIRST_PAUSE", 0.01)


def hop(*places: tuple[float, float], name: str = "a") -> AeroNavigation:
    """Waypoints at these places."""
    stops = [Waypoint(f"{name}{n}", x, y, 2.0) for n, (x, y) in enumerate(places)]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops)


def built(stub: Stub) -> Environment:
    """An application that hops, ready to start."""
    environment = Environment(stub.url, token=TOKEN)
    environment.get_robot_by_id("drone").navigate(hop((2, 0)))
    return environment


@contextmanager
def flying(stub: Stub, **changes: Any) -> Iterator[Environment]:  # noqa: ANN401
    """The same in flight; it lands when the test is done."""
    stub.state = mission(MissionPhase.FLYING, **changes)
    environment = built(stub)
    environment.start_mission(wait=False)
    yield environment
    stub.state = mission(MissionPhase.LANDED)
    environment.wait()


def order(stub: Stub) -> dict[str, Any]:
    """What was submitted."""
    (found,) = stub.sent("POST", "/v1/missions")
    content: dict[str, Any] = json.loads(found)
    return content


def test_the_catalogue_is_the_environment(stub: Stub) -> None:
    """The graph is built and checked against it as against a file."""
    environment = Environment(stub.url, token=TOKEN)
    assert environment.config.name == CATALOGUE["name"]
    assert [robot.robot_id for robot in environment.get_env_robots()] == ["drone"]  # type: ignore[attr-defined]
    assert environment.get_compute_resource_by_id("edge").get_compute_properties()["id"] == "edge"
    with pytest.raises(UnknownIdError, match="no robot is called 'dron'"):
        environment.get_robot_by_id("dron")
    far = environment.get_robot_by_id("drone")
    far.navigate(hop((500, 0)))
    with pytest.raises(InvalidWaypointError, match="fence"):
        far.start_mission()
    assert stub.sent("POST", "/v1/missions") == []


def test_a_catalogue_that_is_none_is_told(stub: Stub) -> None:
    """With the address and the place."""
    fleet = {"name": "x", "robots": [], "environment": {"robots": "many"}}
    stub.refusals["/v1/fleet"] = (200, fleet)
    with pytest.raises(ConfigError, match=r"the catalogue of http://127\.0\.0\.1:.*robots"):
        Environment(stub.url, token=TOKEN)


def test_a_token_is_for_providers_and_settings_are_not(stub: Stub) -> None:
    """Both are told before anything is asked."""
    with pytest.raises(ConfigError, match="a token is for a provider's address"):
        Environment("environment.json", token=TOKEN)
    with pytest.raises(ConfigError, match="the provider's"):
        Environment(stub.url, {"drone.limits.max_speed": 99}, token=TOKEN)
    assert stub.asked == []


def test_the_application_is_submitted_as_data_and_its_recording_comes_back(
    stub: Stub, tmp_path: Path
) -> None:
    """With the options of the run; hooks run at the user's side, in their order."""
    wanted = ProviderOptions(minutes=5, silence="return", silence_seconds=12, share=("club",))
    current_options.set(RunOptions(view=False, record=tmp_path / "out", provider=wanted, seed=7))
    stub.state = mission(MissionPhase.LANDED, recording=True)
    environment = built(stub)
    drone = environment.get_robot_by_id("drone")
    path = tmp_path / "out" / "flight.mcap"
    told: list[str] = []
    drone.on_start(lambda: told.append("start"))
    drone.on_end(lambda: told.append(f"end {path.read_bytes().decode()}"))
    drone.start_mission()
    sent = order(stub)
    assert (sent["minutes"], sent["silence"], sent["silence_seconds"]) == (5, "return", 12)
    assert (sent["share"], sent["seed"]) == (["club"], 7)
    assert sent["document"]["navigation"][0]["waypoints"][0]["x"] == 2.0
    assert told == ["start", "end recorded"]
    assert environment.run is None


@pytest.mark.parametrize("phase", [MissionPhase.REFUSED, MissionPhase.FAILED])
def test_a_mission_that_ends_badly_raises_the_providers_reason(
    stub: Stub, phase: MissionPhase
) -> None:
    """At the line that starts it; the next start submits it anew."""
    verdict = VerdictOut(approved=False, reasons=["it leaves the fence"])
    stub.state = mission(phase, reason="it leaves the fence", verdict=verdict)
    environment = built(stub)
    for attempt in (1, 2):
        with pytest.raises(MissionError, match=f"{phase.value}: it leaves the fence"):
            environment.start_mission()
        assert len(stub.sent("POST", "/v1/missions")) == attempt
    assert stub.sent("DELETE", MISSION) == []


def test_a_flight_that_fails_on_its_way_raises_from_wait(stub: Stub) -> None:
    """Cancelled by another, too."""
    for phase in (MissionPhase.FAILED, MissionPhase.CANCELLED):
        stub.state = mission()
        environment = built(stub)
        environment.start_mission(wait=False)
        stub.state = mission(phase, reason="by the operator")
        with pytest.raises(MissionError, match=f"{phase.value}: by the operator"):
            environment.wait()


def test_models_that_the_provider_lacks_go_first(stub: Stub, tmp_path: Path) -> None:
    """By their hash, once."""
    model = tmp_path / "own.onnx"
    shutil.copy(DETECTOR, model)
    stub.state = mission(MissionPhase.LANDED)
    camera = {"id": "cam", "type": "camera", "rate": 5, "driver": "simulated"}
    content = {**CATALOGUE, "sensors": [camera]}
    fleet = {"name": "campus", "robots": [], "environment": content}
    stub.refusals["/v1/fleet"] = (200, fleet)
    sha256 = hashlib.sha256(model.read_bytes()).hexdigest()
    for number in (1, 2):
        current_options.set(RunOptions(view=False, record=tmp_path / f"out{number}"))
        environment = Environment(stub.url, token=TOKEN)
        stream = environment.get_env_sensor_by_id("cam").get_data_stream()
        VipDetectionAnalytics(model=model).analyse(stream)
        environment.get_robot_by_id("drone").navigate(hop((2, 0)))
        environment.start_mission()
        assert stub.sent("PUT", sha256) == [model.read_bytes()]


def test_commands_go_over_the_wire(stub: Stub) -> None:
    """As the drone's own words come back."""
    with flying(stub) as environment:
        drone = environment.get_robot_by_id("drone")
        drone.pause_mission()
        drone.resume_mission()
        drone.navigate(hop((1, 1), name="b"))
        stub.answer = Answer(accepted=False, text="it is landing")
        with pytest.raises(MissionError, match="drone: it is landing"):
            drone.end_mission()
        with pytest.raises(MissionError, match="it is landing"):
            drone.navigate(hop((3, 3), name="c"))
    words = [json.loads(one)["command"] for one in stub.sent("POST", "/commands")]
    assert words == ["pause", "resume", "land"]
    added = [json.loads(one) for one in stub.sent("POST", "/navigation")]
    assert [one["waypoints"][0]["id"] for one in added] == ["b0", "c0"]
    assert added[0]["robot"] == "drone"
    with pytest.raises(MissionError, match="no longer flying"):
        drone.pause_mission()


def test_navigation_by_a_scheduler_goes_over_the_wire(stub: Stub) -> None:
    """With its place in the queue and its deadline, or a queue to be emptied."""
    environment = Environment(stub.url, token=TOKEN)
    scheduler = OrderedScheduler(environment)
    environment.set_trajectory_scheduler(scheduler)
    drone = environment.get_robot_by_id("drone")
    drone.navigate(scheduler.generate_navigation(hop((2, 0))))
    drone.start_mission(wait=False)
    scheduler.add_navigation(hop((1, 1), name="b"), index=0, deadline=40)
    scheduler.clear_navigation()
    with pytest.raises(GraphError, match="too late to plug in a trajectory scheduler"):
        environment.set_trajectory_scheduler(OrderedScheduler(environment))
    added = [json.loads(one) for one in stub.sent("POST", "/navigation")]
    assert [(one["index"], one["deadline"]) for one in added] == [(0, 40)]
    assert [json.loads(one)["command"] for one in stub.sent("POST", "/commands")] == ["clear"]
    stub.state = mission(MissionPhase.LANDED)
    environment.wait()


def test_a_queue_is_replaced_by_one_request(stub: Stub) -> None:
    """Between two, the drone would have nothing to fly; an empty queue is another command's."""
    with flying(stub) as environment:
        environment.command("drone", AddNavigation(hop((1, 1)), deadline=40, clear_first=True))
        (sent,) = [json.loads(one) for one in stub.sent("POST", "/navigation")]
        arrived = NavigationIn.model_validate(sent).command()
        assert (arrived.deadline, arrived.clear_first) == (40.0, True)
        assert [one.id for one in arrived.navigation.waypoints] == ["a0"]
        assert stub.sent("POST", "/commands") == []
        with pytest.raises(MissionError, match="the navigation is empty"):
            environment.command("drone", AddNavigation(AeroNavigation()))


def test_what_was_not_submitted_cannot_be_added(stub: Stub) -> None:
    """Sensors and analyses: the graph stays as it was."""
    with flying(stub) as environment:
        drone = environment.get_robot_by_id("drone")
        with pytest.raises(GraphError, match="too late to add drone/odom"):
            drone.get_sensor_by_id("odom").get_data_stream()
        assert environment.graph.nodes == {}


def test_items_of_streams_arrive_in_flight(stub: Stub) -> None:
    """By iteration, by poll and by callback; the streams end with the mission."""
    stub.items = [({"seq": n, "item": pack(n)[0]}, b"") for n in range(3)]
    environment = built(stub)
    sensor = environment.get_robot_by_id("drone").get_sensor_by_id("odom")
    stream = sensor.get_data_stream()
    called: list[object] = []
    third = threading.Event()

    def take(item: object) -> None:
        called.append(item)
        if len(called) == 3:
            third.set()

    sensor.subscribe(take)
    with pytest.raises(GraphError, match="no data before the mission starts"):
        next(stream)
    environment.start_mission(wait=False)
    assert [next(stream) for _ in range(3)] == [0, 1, 2]
    assert sensor.poll(20) in {0, 1, 2}
    assert third.wait(20)
    stub.state = mission(MissionPhase.LANDED)
    assert list(stream) == []
    environment.wait()
    assert called == [0, 1, 2]


def test_control_c_brings_the_drones_home_and_waits(
    stub: Stub, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The recording is there when the application goes on; being called home is no failure."""
    stub.on_cancel = lambda: setattr(
        stub, "state", mission(MissionPhase.CANCELLED, reason="cancelled by ann", recording=True)
    )
    environment = built(stub)
    environment.start_mission(wait=False)
    await_change = follower.MissionFollower.await_change
    pressed: list[int] = []

    def interrupted(self: Any, seen: int, timeout: float) -> Any:  # noqa: ANN401
        if not pressed:
            pressed.append(1)
            raise KeyboardInterrupt
        return await_change(self, seen, timeout)

    monkeypatch.setattr(follower.MissionFollower, "await_change", interrupted)
    with pytest.raises(KeyboardInterrupt):
        environment.wait()
    assert len(stub.sent("DELETE", MISSION)) == 1
    assert (tmp_path / "out" / "flight.mcap").read_bytes() == b"recorded"


def test_an_application_that_ends_without_waiting_calls_the_drones_home(stub: Stub) -> None:
    """As it lands its own."""
    stub.on_cancel = lambda: setattr(stub, "state", mission(MissionPhase.CANCELLED))
    environment = built(stub)
    environment.start_mission(wait=False)
    run: Any = environment._mission
    run.abandon()
    run.abandon()
    assert len(stub.sent("DELETE", MISSION)) == 1
    with pytest.raises(MissionError, match="no longer flying"):
        environment.get_robot_by_id("drone").pause_mission()


def test_a_start_that_is_interrupted_leaves_no_mission_behind(
    stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What waits for its drones would fly unwatched."""
    stub.state = mission(MissionPhase.QUEUED)

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(follower.MissionFollower, "await_change", interrupted)
    environment = built(stub)
    with pytest.raises(KeyboardInterrupt):
        environment.start_mission()
    assert len(stub.sent("DELETE", MISSION)) == 1


def test_an_answer_that_is_lost_is_told_with_the_remedy(
    stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The mission may fly: what is sent again has the same key, and the last word is how to see."""
    monkeypatch.setattr(client_module, "_RESEND_SECONDS", 1.0)
    environment = built(stub)
    environment.provider._exchange._client.timeout = 0.3  # type: ignore[union-attr]
    stub.slow = threading.Event()
    with pytest.raises(SourceError, match="aerodaas missions"):
        environment.start_mission()
    assert len(stub.keys) > 1
    assert len(set(stub.keys)) == 1


def test_each_start_has_a_key_of_its_own(stub: Stub) -> None:
    """Two flights of one application are two missions."""
    stub.refusals["/v1/missions"] = (409, {"text": "not now"})
    for _ in range(2):
        with pytest.raises(MissionError, match="not now"):
            built(stub).start_mission()
    assert len(set(stub.keys)) == 2
    assert None not in stub.keys


OWN: dict[str, Callable[[], RunOptions]] = {
    "speed": lambda: RunOptions(view=False, speed=2.0),
    "address": lambda: RunOptions(view=False, address="auto"),
    "live": lambda: RunOptions(view=False, live="127.0.0.1:8765"),
    "show": lambda: RunOptions(view=False, show=("ros2",)),
}


@pytest.mark.parametrize("name", OWN)
def test_options_of_ones_own_runtime_are_refused(stub: Stub, name: str) -> None:
    """Rather than ignored; nothing is submitted."""
    current_options.set(OWN[name]())
    with pytest.raises((ConfigError, GraphError), match="one's own"):
        built(stub).start_mission()
    assert stub.sent("POST", "/v1/missions") == []


def test_a_recording_is_not_overwritten(stub: Stub, tmp_path: Path) -> None:
    """Nothing is submitted."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "flight.mcap").write_bytes(b"another flight's")
    with pytest.raises(RecordingError, match="already exists"):
        built(stub).start_mission()
    assert stub.sent("POST", "/v1/missions") == []


def test_a_recording_that_cannot_be_fetched_is_no_failed_mission(
    stub: Stub, capsys: pytest.CaptureFixture[str]
) -> None:
    """It landed; the remedy is told."""
    stub.state = mission()
    environment = built(stub)
    environment.start_mission(wait=False)
    stub.state = mission(MissionPhase.LANDED, recording=True)
    run: Any = environment._mission
    assert run._follower.await_end(20)
    stub.refusals[f"/v1/missions/{MISSION}/recording"] = (403, {"text": "the scope is missing"})
    environment.wait()
    said = capsys.readouterr().err
    assert "the scope is missing" in said
    assert f"aerodaas missions fetch {MISSION}" in said


def test_an_environment_flies_again_after_a_mission(stub: Stub, tmp_path: Path) -> None:
    """With the navigation given since; each flight has a recording of its own."""
    stub.state = mission(MissionPhase.LANDED, recording=True)
    environment = built(stub)
    environment.start_mission()
    environment.get_robot_by_id("drone").navigate(hop((5, 5), name="second"))
    environment.start_mission()
    sent = [json.loads(one)["document"] for one in stub.sent("POST", "/v1/missions")]
    flown = [[edge["waypoints"][0]["id"] for edge in one["navigation"]] for one in sent]
    assert flown == [["a0"], ["second0"]]
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert names == ["flight-2.mcap", "flight.mcap"]


def test_an_analysis_stays_with_the_graph(stub: Stub) -> None:
    """Registered ones go by name, deployed where the catalogue has it."""
    stub.state = mission(MissionPhase.LANDED)
    environment = built(stub)
    stream = environment.get_robot_by_id("drone").get_sensor_by_id("odom").get_data_stream()
    edge = environment.get_compute_resource_by_id("edge")
    MonitoringAnalytics(["height"]).deploy(edge).analyse(stream)
    environment.start_mission()
    (entry,) = order(stub)["document"]["analyses"]
    assert entry["analysis"] == "MonitoringAnalytics"
    assert entry["compute"] == "edge"

"""Missions flown by a provider's service, in processes of its own: their lives and their ends."""

from __future__ import annotations

import json
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from served import Served, document, fleet, robot
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from aerodaas.environment.provider.logins import client_for
from aerodaas.files.file_lock import actor_lock, is_locked

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]

FAR = ((25.0, 0.0), (25.0, 25.0), (0.0, 25.0))
"""A way of 40 seconds, and 12 back."""


@pytest.fixture(scope="module")
def provider() -> Iterator[Served]:
    """Two drones in real time, without rehearsals."""
    with Served(fleet(robot("one"), robot("two", 10)), "--no-rehearse") as served:
        yield served


def submitted(provider: Served, name: str, *places: tuple[float, float], **more: object) -> str:
    """Submit a mission; returns its id."""
    body = {"document": document(name, *places), **more}
    answer = provider.ask("POST", "/v1/missions", body)
    assert isinstance(answer, dict), answer
    return str(answer["id"])


def state_of(mission: dict[str, Any], name: str) -> str:
    """State of a mission's drone."""
    return str(mission["status"].get(name, {}).get("mission", {}).get("state", ""))


def flying(provider: Served, id_: str, name: str, *states: str) -> None:
    """Wait until the mission's drone is in one of these states."""
    wanted = states or ("enroute",)
    provider.until(lambda: state_of(provider.mission(id_), name) in wanted)


def process_of(provider: Served, id_: str) -> psutil.Process:
    """The process of a mission's flight."""
    words = str(provider.folder / "s" / "m" / id_)
    for process in psutil.process_iter(["cmdline"]):
        line = process.info["cmdline"] or []
        if "aerodaas.flights" in line and line[-1].startswith(words):
            return process
    raise AssertionError(id_)


def test_commands_reach_the_drone_and_answers_come_back(provider: Served) -> None:
    """Pause holds it, waypoints join its queue, and what it refuses is told with the reason."""
    id_ = submitted(provider, "one", *FAR)
    command = f"/v1/missions/{id_}/commands"
    flying(provider, id_, "one")
    assert provider.ask("POST", command, {"robot": "one", "command": "pause"})["accepted"]
    flying(provider, id_, "one", "paused")
    place = {"id": "more", "x": 3.0, "y": 3.0, "z": 2.0, "waypoint_type": "local"}
    more = {"robot": "one", "waypoints": [place]}
    answer = provider.ask("POST", f"/v1/missions/{id_}/navigation", more)
    assert answer["accepted"], answer
    outside = {"robot": "one", "waypoints": [{**place, "id": "outside", "x": 500.0}]}
    refused = provider.ask("POST", f"/v1/missions/{id_}/navigation", outside)
    assert not refused["accepted"]
    assert "outside" in refused["refused"]
    nobody = provider.ask("POST", command, {"robot": "two", "command": "land"})
    assert not nobody["accepted"]
    assert provider.ask("POST", command, {"robot": "one", "command": "resume"})["accepted"]
    ended = provider.until_phase(id_)
    assert ended["phase"] == "landed"
    assert set(ended["status"]["one"]["mission"]["visited"]) == {"wp0", "wp1", "wp2", "more"}
    late = provider.ask("POST", command, {"robot": "one", "command": "pause"})
    assert late == (409, f"{id_} is over: landed")


def test_a_pilot_surveys_rearranges_and_flies_by_hand(provider: Served) -> None:
    """Of the mission's own tenant alone, one at a time; a disabled account lets go."""
    id_ = submitted(provider, "one", *FAR)
    routes = {name: f"/v1/missions/{id_}/{name}" for name in ("survey", "plan")}
    flying(provider, id_, "one")
    area = {"robot": "one", "area": [[5, 5], [15, 5], [15, 12], [5, 12]], "height": 3, "width": 4}
    survey = provider.ask("POST", routes["survey"], area)
    assert survey["sweeps"] >= 2
    assert 0.0 < survey["battery"] < survey["available"]
    assert all(5 <= one["x"] <= 15 and 5 <= one["y"] <= 12 for one in survey["waypoints"])
    beyond = {**area, "area": [[50, 50], [80, 50], [80, 80]]}
    assert "fence" in str(provider.ask("POST", routes["survey"], beyond))
    order = {"robot": "one", "order": ["wp2", "wp1"]}
    mine = provider.ask("GET", "/v1/me")["tenant"]
    viewer, stranger = provider.user("vic", mine, "viewer"), provider.user("eve", "others")
    for route, body in ((routes["survey"], area), (routes["plan"], order)):
        assert provider.send("POST", route, body, viewer)[0] == 403
        assert provider.send("POST", route, body, stranger)[0] == 404
    assert provider.ask("POST", routes["plan"], order)["accepted"]
    provider.until(lambda: planned(provider, id_) == ["wp2", "wp1"])
    for token, status in ((viewer, 403), (stranger, 404), ("aerodaas_wrong", 401)):
        with pytest.raises(InvalidStatus) as refused, by_hand(provider, id_, token):
            pass
        assert refused.value.response.status_code == status
    with by_hand(provider, id_, provider.user("hana", mine)) as controls:
        assert json.loads(controls.recv(20))["held"]
        with by_hand(provider, id_, provider.token) as second:
            answer = json.loads(second.recv(20))
        assert (answer["held"], answer["text"]) == (False, "hana has the controls")
        until = time.monotonic() + 30.0
        while height(provider, id_) < 3.0:
            assert time.monotonic() < until
            climb(controls)
        assert told(provider, id_)["mission"]["pilot"] == "hana"
        provider.ask("PATCH", "/v1/accounts/hana", {"disabled": True})
        with pytest.raises(ConnectionClosed):
            climb(controls, until)
    provider.until(lambda: told(provider, id_)["mission"]["pilot"] == "")
    assert told(provider, id_)["mission"]["state"] == "paused"
    home = {"robot": "one", "command": "return-home"}
    assert provider.ask("POST", f"/v1/missions/{id_}/commands", home)["accepted"]
    assert provider.until_phase(id_)["phase"] == "landed"
    noted = {one["action"] for one in provider.ask("GET", "/v1/audit") if id_ in one["target"]}
    assert {"mission.plan", "mission.controls"} <= noted


def told(provider: Served, id_: str) -> dict[str, Any]:
    """What the mission's drone says of itself."""
    status: dict[str, Any] = provider.mission(id_)["status"]["one"]
    return status


def planned(provider: Served, id_: str) -> list[str]:
    """Ids of the waypoints after the drone's target."""
    return [one["id"] for one in told(provider, id_)["mission"]["pending"]]


def height(provider: Served, id_: str) -> float:
    """Metres of the drone above home."""
    return float(told(provider, id_)["vehicle"]["odometry"]["position"]["z"])


def by_hand(provider: Served, id_: str, token: str) -> ClientConnection:
    """The controls of a mission's drone."""
    words = [Subprotocol("aerodaas"), Subprotocol(f"bearer.{token}")]
    url = f"{provider.url.replace('http', 'ws')}/v1/missions/{id_}/controls?robot=one"
    return connect(url, subprotocols=words)


def climb(controls: ClientConnection, until: float = 0.0) -> None:
    """Ask to climb, once or again and again, and take the answers."""
    asked = False
    while not asked or time.monotonic() < until:
        controls.send(json.dumps({"up": 0.5, "at": 1000.0 * time.monotonic()}))
        controls.recv(20)
        asked = True


def test_a_flight_that_is_cancelled_while_it_is_launched_does_not_fly(provider: Served) -> None:
    """Its process takes seconds to listen, and its drones more to take off."""
    id_ = submitted(provider, "one", *FAR)
    provider.until_phase(id_, "flying")
    answer = provider.ask("DELETE", f"/v1/missions/{id_}")
    assert answer["phase"] == "flying", answer
    ended = provider.until_phase(id_)
    assert ended["phase"] == "cancelled", ended["reason"]
    assert ended["status"].get("one", {}).get("mission", {}).get("visited", []) == []


def test_a_service_that_is_killed_finds_its_flights_again(provider: Served) -> None:
    """They fly on meanwhile, and none is begun twice."""
    id_ = submitted(provider, "one", *FAR)
    flying(provider, id_, "one")
    process = process_of(provider, id_)
    provider.stop(signal.SIGKILL)
    time.sleep(2.0)
    assert process.is_running()
    provider.start()
    found = provider.mission(id_)
    assert found["phase"] == "flying"
    provider.until(lambda: state_of(provider.mission(id_), "one") != "")
    assert process_of(provider, id_) == process
    answer = provider.ask(
        "POST", f"/v1/missions/{id_}/commands", {"robot": "one", "command": "pause"}
    )
    assert answer["accepted"], answer
    provider.ask("POST", f"/v1/missions/{id_}/commands", {"robot": "one", "command": "resume"})
    ended = provider.until_phase(id_)
    assert ended["phase"] == "landed"
    assert ended["status"]["one"]["mission"]["visited"] == ["wp0", "wp1", "wp2"]


def test_what_ended_while_the_service_was_away_is_told(provider: Served) -> None:
    """A flight writes its outcome into its folder, which the next service reads."""
    id_ = submitted(provider, "one", (3.0, 0.0))
    flying(provider, id_, "one", "taking_off", "enroute")
    process = process_of(provider, id_)
    # Asked to end, as by Ctrl-C, it leaves its flights alone as well.
    provider.stop(signal.SIGTERM)
    process.wait(120)
    provider.start()
    ended = provider.until_phase(id_)
    assert ended["phase"] == "landed"
    assert ended["status"]["one"]["mission"]["visited"] == ["wp0"]
    assert [one["mission"] for one in provider.ask("GET", "/v1/usage")].count(id_) == 1


def test_a_lost_flight_takes_its_drone_out_of_service(provider: Served) -> None:
    """Nobody knows where it is, so nobody gets it before an operator has looked."""
    id_ = submitted(provider, "two", *((one[0] + 10, one[1]) for one in FAR))
    flying(provider, id_, "two")
    flight = process_of(provider, id_)
    lock = actor_lock(provider.folder / "s" / "locks", "two")
    os.kill(flight.pid, signal.SIGKILL)
    ended = provider.until_phase(id_)
    assert ended["phase"] == "failed"
    assert "out of service until an operator has looked" in ended["reason"]
    refused = provider.ask("POST", "/v1/missions", {"document": document("two", (12, 0))})
    assert refused[0] == 409
    assert provider.send("PATCH", "/v1/robots/two", {"enabled": True})[0] == 204
    again = submitted(provider, "two", (12.0, 0.0))
    # Whoever has looked too soon: its actor brings it home, and nobody else flies it meanwhile.
    assert is_locked(lock)
    provider.until(lambda: "two" in provider.mission(again)["reason"])
    assert provider.until_phase(again, "flying")["phase"] == "flying"
    assert not is_locked(lock), "the next actor takes seconds to begin"
    assert provider.until_phase(again)["phase"] == "landed"


def test_a_lease_that_ends_brings_the_drone_home(provider: Served) -> None:
    """It expires by the flight's own clock; afterwards its user commands no more."""
    pilot = provider.user("late", "growers")
    body = {"document": document("one", *FAR), "minutes": 0.7}
    id_ = provider.ask("POST", "/v1/missions", body, pilot)["id"]
    flying(provider, id_, "one")
    flying(provider, id_, "one", "returning", "landing", "landed")
    pause = {"robot": "one", "command": "pause"}
    late = provider.ask("POST", f"/v1/missions/{id_}/commands", pause, pilot)
    assert late["text"].startswith("the drones come home: the lease has ended")
    ended = provider.until_phase(id_)
    assert "the lease has ended" in ended["reason"]
    assert len(ended["status"]["one"]["mission"]["visited"]) < 3


def test_a_silent_user_is_a_reason_to_return_where_the_mission_says_so(provider: Served) -> None:
    """Also while the service is gone: the flight's process listens for itself."""
    id_ = submitted(provider, "one", *FAR, silence="return", silence_seconds=4)
    flying(provider, id_, "one")
    provider.stop(signal.SIGKILL)
    time.sleep(6.0)
    provider.start()
    ended = provider.until_phase(id_)
    assert "nothing was heard of the user for 4 s" in ended["reason"]
    assert len(ended["status"]["one"]["mission"]["visited"]) < 3


def test_the_recording_comes_back(provider: Served, tmp_path: Path) -> None:
    """Once the flight is over, and to its own tenant."""
    id_ = submitted(provider, "one", (2.0, 0.0))
    assert provider.send("GET", f"/v1/missions/{id_}/recording")[0] == 404
    assert provider.send("DELETE", f"/v1/missions/{id_}/recording")[0] == 404
    provider.until_phase(id_)
    status, content = provider.send("GET", f"/v1/missions/{id_}/recording")
    assert status == 200
    path = tmp_path / "flight.mcap"
    path.write_bytes(content)
    from aerodaas.recording.report.report import read_report  # noqa: PLC0415 - loads the plots

    assert read_report(path).summary.robots["one"].waypoints_visited == 1
    other = provider.user("other", "elsewhere")
    assert provider.send("GET", f"/v1/missions/{id_}/recording", token=other)[0] == 404
    assert provider.send("DELETE", f"/v1/missions/{id_}/recording", token=other)[0] == 404
    client = client_for(provider.url, provider.token)
    kept = {one.mission: one.kept for one in client.usage()}
    assert kept[id_]
    assert client.mission(id_).recording
    client.delete_recording(id_)
    assert not client.mission(id_).recording
    assert {one.mission: one.kept for one in client.usage()} == kept | {id_: False}
    assert provider.send("GET", f"/v1/missions/{id_}/recording")[0] == 404
    assert provider.send("DELETE", f"/v1/missions/{id_}/recording")[0] == 404

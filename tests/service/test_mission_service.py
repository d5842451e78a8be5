"""The service: one mission's failure is its own, and limits of time and room are kept."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from offered import PILOT, SUBMITTED_PHASES, Provider
from pydantic import ValidationError
from served import document

from aerodaas.config.model import SimulationConfig
from aerodaas.errors import MissionError
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    LeaseIn,
    MissionIn,
    MissionPhase,
    Role,
    VerdictOut,
)
from aerodaas.service import mission as missions
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import Outcome
from aerodaas.service.models import model_store as models
from aerodaas.service.store import Account, Tenant


def unwatched(folder: Path, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> Provider:  # noqa: ANN401
    """A service over a fleet of two without a monitor, whose processes never run."""
    return Provider(folder, monkeypatch, watched=False, **settings)


@pytest.fixture
def one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A service that rehearses nothing."""
    made = unwatched(tmp_path, monkeypatch, rehearse=False)
    yield made
    made.close()


def test_what_one_mission_meets_is_its_own(one: Provider) -> None:
    """A lease that cannot be had refuses that mission, with the reason; the next one flies."""
    stuck = one.submit("one")
    one.turns(1)
    one.store.robots.put(one.store.robots.get("one") or _out("one"))
    one.missions._registry.take_out_of_service(["one"])
    good = one.submit("two")
    one.turns()
    assert one.phase(stuck) is MissionPhase.REFUSED
    assert "out of service" in one.missions.shown(stuck.id).reason
    assert one.phase(good) is MissionPhase.FLYING


def _out(name: str) -> Any:  # noqa: ANN401 - a row
    from aerodaas.service.store import RobotState  # noqa: PLC0415 - only here

    return RobotState(name)


def test_a_rehearsal_has_its_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One that does not end is refused, and not waited for."""
    made = unwatched(tmp_path, monkeypatch, rehearse=True, rehearsal_seconds=60.0)
    ended: list[bool] = []
    monkeypatch.setattr(
        missions.ActiveMission, "end_rehearsal", lambda _: ended.append(True), raising=True
    )
    slow = made.submit("one")
    made.turns(2)
    assert made.phase(slow) is MissionPhase.REHEARSING
    began = time.monotonic()
    with monkeypatch.context() as later:
        later.setattr("aerodaas.service.mission.time.monotonic", lambda: began + 241.0)
        made.turns(1)
    assert made.phase(slow) is MissionPhase.REFUSED
    reason = made.missions.shown(slow.id).reason
    assert "its rehearsal did not end within 240 s" in reason
    assert ended
    made.store.close()


def test_rehearsals_take_turns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As many at once as the provider has cores; nobody waits for all that others have sent."""
    made = unwatched(tmp_path, monkeypatch, rehearse=True, most_rehearsals=1, most_flights=0)
    made.store.tenants.add(Tenant("city"))
    made.store.accounts.add(Account("warden", "city", Role.PILOT, frozenset(USUAL_SCOPES), 0.0))
    farm = [made.submit("one") for _ in range(3)]
    made.turns(1)
    city = made.missions.submit(
        replace(PILOT, account="warden", tenant="city"),
        MissionIn.model_validate({"document": document("two", (5, 0))}),
    )
    made.turns()
    assert [made.phase(one).value for one in farm] == ["rehearsing", "submitted", "submitted"]
    assert made.phase(city) is MissionPhase.SUBMITTED
    assert "number 1 " in made.missions.shown(city.id).reason
    approved = Outcome(landed=True, began=0.0, ended=1.0, verdict=VerdictOut(approved=True))
    for count, begun in enumerate((city, farm[1], farm[2]), 1):
        made.started[-1].end(approved)
        made.turns(2)
        assert len(made.started) == count + 1
        assert made.started[-1].path.parent.name == begun.id
    made.close()


def test_rehearsals_of_a_former_service_take_turns(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many it had under way."""
    made = unwatched(tmp_path, monkeypatch, rehearse=True, most_rehearsals=3)
    for _ in range(3):
        made.submit("one")
    made.turns()
    made.started.clear()
    made.settings = replace(made.settings, most_rehearsals=1)
    made.open()
    made.turns()
    assert len(made.started) == 1
    made.close()


def test_a_full_disk_takes_no_missions(one: Provider, monkeypatch: pytest.MonkeyPatch) -> None:
    """The flying ones need the room that is left."""
    monkeypatch.setattr(models, "_LEAST_FREE", 1 << 60)
    with pytest.raises(RefusedError, match="make room") as refused:
        one.submit("one")
    assert refused.value.status == 507


def test_one_key_is_one_mission_however_many_send_it_at_once(one: Provider) -> None:
    """Also while none of them is kept yet; what the others wrote is gone."""
    with ThreadPoolExecutor(8) as pool:
        ids = {found.id for found in pool.map(lambda _: one.submit("one", "k"), range(8))}
    assert len(ids) == 1
    assert [row.id for row in one.store.missions.open()] == list(ids)
    assert {path.name for path in one.settings.missions.iterdir()} == ids


def test_what_has_used_up_its_quota_is_still_found_by_its_key(one: Provider) -> None:
    """The answer to a repeated submission does not depend on what happened since."""
    first = one.submit("one", "k")
    one.missions._registry.take_out_of_service(["one"])
    assert one.submit("one", "k").id == first.id
    with pytest.raises(RefusedError, match="out of service"):
        one.submit("one", "other")


def test_missions_that_wait_together_fly_no_longer_than_the_quota(one: Provider) -> None:
    """Each alone was within it when it was submitted, and no lease counted yet."""
    one.store.tenants.put(Tenant("farm", flight_minutes=20.0))
    first, second = one.submit("one"), one.submit("two")
    one.turns()
    assert one.phase(first) is MissionPhase.FLYING
    assert one.phase(second) is MissionPhase.REFUSED
    assert "leaves 5.0 flight minutes" in one.missions.shown(second.id).reason


def test_a_lease_counts_once_for_the_quota(one: Provider) -> None:
    """Its mission needs no further minutes."""
    one.store.tenants.put(Tenant("farm", flight_minutes=20.0))
    lease = one.leases.request(PILOT, LeaseIn(robots=["one"], minutes=15.0))
    mission = one.submit("one", lease=lease.id)
    one.turns()
    assert one.phase(mission) is MissionPhase.FLYING


def _nested(levels: int) -> list[Any]:
    return [_nested(levels - 1)] if levels else []


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ("\ud800", "half of a surrogate pair"),
        ({"\ud800": 1}, "half of a surrogate pair"),
        (_nested(300), "more than 40 levels"),
        (float("nan"), "must be a finite number"),
    ],
    ids=["text", "key", "deep", "number"],
)
@pytest.mark.parametrize("place", ["settings", "task", "triggers", "trajectory_scheduler"])
def test_what_no_file_can_hold_is_refused_before_one_is_made(
    value: object, told: str, place: str
) -> None:
    """It would be the service's own failure, with a folder for each."""
    watch: dict[str, Any] = {"id": "one/watch", "analysis": "MonitoringAnalytics"}
    changes: dict[str, Any] = {"analyses": [watch]}
    if place == "triggers":
        watch[place] = [{"target": "one", "command": "end_mission", "when": value}]
    elif place == "trajectory_scheduler":
        changes[place] = {"name": "optimal", "settings": {"x": value}}
    else:
        watch[place] = {"x": value}
    with pytest.raises(ValidationError, match=told):
        MissionIn.model_validate({"document": document("one", (5, 0), **changes)})


def test_a_mission_is_taken_up_again_by_the_next_service(one: Provider) -> None:
    """A flight that was ordered and has not begun is begun; one that has begun is not."""
    first, second = one.submit("one"), one.submit("two")
    one.turns()
    flights = {folder.path.parent.name: folder.path for folder in one.started}
    assert set(flights) == {first.id, second.id}
    (flights[second.id] / "begun").touch()
    one.started.clear()
    # A service that ends leaves its flights alone: the stand-in has no process id to be killed by.
    one.missions.close()
    one.open()
    one.turns(1)
    assert [folder.path for folder in one.started] == [flights[first.id]]


def test_a_rehearsal_that_ended_with_its_service_is_begun_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the next one; one that has a result is judged by that, and not flown twice."""
    made = unwatched(tmp_path, monkeypatch, rehearse=True, most_rehearsals=2)
    lost, judged = made.submit("one"), made.submit("two")
    made.turns(1)
    assert len(made.started) == 2
    outcome = Outcome(
        landed=True, reason="", began=0.0, ended=1.0, verdict=VerdictOut(approved=True)
    )
    made.missions._missions[judged.id].rehearsal.end(outcome)
    made.started.clear()
    made.open()
    made.turns(3)
    assert [folder.path for folder in made.started] == [
        made.missions._missions[lost.id].rehearsal.path,
        made.missions._missions[judged.id].flight.path,
    ]
    assert made.phase(lost) is MissionPhase.REHEARSING
    made.store.close()


def test_leases_end_while_the_database_is_gone(
    one: Provider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the service goes on when it is back."""
    mission = one.submit("one")
    one.turns()
    assert one.phase(mission) is MissionPhase.FLYING
    ticks: list[bool] = []

    def gone(*_: object) -> None:
        raise StoreError("no database")

    with monkeypatch.context() as broken:
        broken.setattr(one.store.missions, "put", gone)
        broken.setattr(one.leases, "advance", lambda: ticks.append(True))
        queued = one.missions._missions[mission.id]
        broken.setattr(queued, "flight_outcome", gone)
        with pytest.raises(StoreError):
            one.turns(1)
    assert ticks
    one.turns(1)
    assert one.phase(mission) is MissionPhase.FLYING


def test_what_fails_each_turn_is_logged_once(
    one: Provider, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """And again once it is something else; its end, too. A fault of ours has its traceback."""
    failures = iter([StoreError("no room"), StoreError("no room"), StoreError("gone")])

    def failing() -> None:
        raise next(failures, KeyError("ours"))

    with monkeypatch.context() as broken:
        broken.setattr(one.leases, "advance", failing)
        for _ in range(5):
            one.missions._try()
    for _ in range(2):
        one.missions._try()
    said = [(line.getMessage(), bool(line.exc_info)) for line in caplog.records]
    assert said == [
        ("missions: no room", False),
        ("missions: gone", False),
        ("missions: 'ours'", True),
        ("missions: goes on", False),
    ]


def test_so_is_a_flight_that_cannot_be_heard(
    one: Provider, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """It flies on by itself."""
    mission = one.submit("one")
    one.turns()
    with monkeypatch.context() as broken:
        broken.setattr(one.missions._missions[mission.id], "flight_outcome", _unreadable)
        one.turns(3)
    one.turns(2)
    assert one.phase(mission) is MissionPhase.FLYING
    said = [line.getMessage() for line in caplog.records]
    assert said == [f"{mission.id}: unreadable", f"{mission.id}: goes on"]


def _unreadable(*_: object) -> None:
    raise OSError("unreadable")


def test_a_flight_is_followed_once(one: Provider, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many ask for it first: each link more would look for its flight for ever."""
    made: list[object] = []

    class Link:
        mission = None
        number = 0

        def __init__(self, *_: object) -> None:
            time.sleep(0.05)
            made.append(self)

        def close(self) -> None:
            """Nothing."""

    monkeypatch.setattr(missions, "FlightLink", Link)
    mission = one.submit("one")
    active = one.missions._missions[mission.id]
    with ThreadPoolExecutor(8) as pool:
        links = set(pool.map(lambda _: active.follow(), range(8)))
    assert links == set(made)
    assert len(made) == 1


def test_trees_stand_where_the_missions_own_seed_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On the map of a mission that asked for one; the fleet's seed is for all others."""
    served = unwatched(tmp_path, monkeypatch)
    wooded = served.settings.config.model_copy(
        update={"simulation": SimulationConfig(world="campus")}
    )
    served.settings = replace(served.settings, config=wooded)
    served.open()
    known = SceneryOut.of(wooded)
    own, other = served.submit("one", seed=3), served.submit("two")
    assert served.missions.scenery(PILOT, own.id) == SceneryOut.of(wooded, 3) != known
    assert served.missions.scenery(PILOT, other.id) == known


def test_a_cancellation_during_launch_is_kept(one: Provider) -> None:
    """The flight's process does not listen yet: it finds it in its folder, whoever serves then."""
    mission = one.submit("one")
    one.turns()
    assert one.phase(mission) is MissionPhase.FLYING
    answer = one.missions.cancel(PILOT, mission.id)
    assert (answer.phase, answer.reason) == (MissionPhase.FLYING, "cancelled by pilot")
    one.missions.close()
    one.open()
    one.turns(1)
    assert one.missions.shown(mission.id).reason == "cancelled by pilot"
    flight = one.started[-1]
    assert flight.cancelled == "cancelled by pilot"
    aborted = "one: aborted: cancelled by pilot before take-off"
    flight.end(Outcome(landed=False, reason=aborted, began=0.0, ended=1.0))
    one.turns(1)
    assert one.phase(mission) is MissionPhase.CANCELLED


@pytest.mark.parametrize("phase", SUBMITTED_PHASES)
def test_a_mission_is_cancelled_once_in_each_phase(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, phase: MissionPhase
) -> None:
    """The second time it is told as over, before and after the service has moved on."""
    early = {MissionPhase.SUBMITTED, MissionPhase.REHEARSING}
    made = unwatched(
        tmp_path,
        monkeypatch,
        rehearse=phase in early,
        approval=phase is MissionPhase.AWAITING_APPROVAL,
        most_flights=0 if phase is MissionPhase.QUEUED else 1,
    )
    monkeypatch.setattr(missions.ActiveMission, "end_rehearsal", lambda _: None)
    mission = made.submit("one")
    made.turns(0 if phase is MissionPhase.SUBMITTED else 4)
    assert made.phase(mission) is phase
    found = made.missions.cancel(PILOT, mission.id)
    assert found.reason == "cancelled by pilot"
    if phase is MissionPhase.FLYING:
        assert made.missions.cancel(PILOT, mission.id).phase is phase
        made.started[-1].end(Outcome(landed=True, reason=found.reason, began=0.0, ended=1.0))
        made.turns(1)
    assert made.phase(mission) is MissionPhase.CANCELLED
    for _ in range(2):
        with pytest.raises(RefusedError, match="over") as refused:
            made.missions.cancel(PILOT, mission.id)
        assert refused.value.status == 409
        made.turns(1)
    made.close()


def test_a_cancellation_that_is_neither_kept_nor_heard_is_refused(
    one: Provider, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a full disk, of a flight that does not listen: nobody may believe that it comes home."""
    mission = one.submit("one")
    one.turns()
    monkeypatch.setattr(FlightFolder, "cancel", _unreadable)
    with pytest.raises(MissionError, match="does not answer"):
        one.missions.cancel(PILOT, mission.id)
    one.turns(1)
    assert one.missions.shown(mission.id).reason == ""

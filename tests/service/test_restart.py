"""A restart among thousands of missions: each goes on where it was; no drone is flown twice."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from flight_orders import order_in
from offered import PILOT, SUBMITTED_PHASES, Provider
from served import document, fleet, robot
from test_mission_service import unwatched

from aerodaas.errors import MissionError
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    LeaseIn,
    LeaseState,
    MissionOut,
    MissionPhase,
    Role,
)
from aerodaas.service.access.principal import Principal
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.folder import FlightFolder, RobotLocks
from aerodaas.service.store import Account, Mission, Tenant

pytestmark = pytest.mark.wall_clock

CROWD = Principal("crowd", "crowd", Role.PILOT, frozenset(USUAL_SCOPES), "t")
ROWS = 3000
HOLD = """
import sys
from pathlib import Path
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.folder import RobotLocks
from aerodaas.service.flights.orders import FlightOrder
with RobotLocks(Path(sys.argv[1])).hold(["one"]):
    print("held", flush=True)
    sys.stdin.read()
"""


@contextmanager
def held(locks: Path) -> Iterator[subprocess.Popen[str]]:
    """A process that flies drone `one`."""
    command = [sys.executable, "-c", HOLD, str(locks)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "held\n"
        try:
            yield process
        finally:
            process.kill()


def crowded(served: Provider, phase: MissionPhase, **changes: object) -> None:
    """Add thousands of newer missions of another tenant for drone `two`."""
    served.store.tenants.put(Tenant("crowd"))
    served.store.accounts.put(Account("crowd", "crowd", Role.PILOT, frozenset(USUAL_SCOPES), 0.0))
    request = {"minutes": 1.0, "silence": "continue", "silence_seconds": 30.0, "seed": None}
    row = Mission("", "visits", "crowd", "crowd", phase, ("two",), 4e9, "", request=request)
    row = replace(row, **changes)  # type: ignore[arg-type]
    rows = [replace(row, id=f"c{n}", submitted=4e9 + n, folder=f"/c{n}") for n in range(ROWS)]
    served.store.missions.put(*rows)


def reach(served: Provider, phase: MissionPhase) -> MissionOut:
    """A mission for drone `one` in a phase."""
    blocked = served.settings
    if phase is MissionPhase.QUEUED:
        served.settings = replace(blocked, most_flights=0)
        served.open()
    mission = served.submit("one")
    if phase is not MissionPhase.SUBMITTED:
        served.turns()
    served.settings = blocked
    assert served.phase(mission) is phase
    return mission


@pytest.mark.parametrize("of_crowd", [MissionPhase.AWAITING_APPROVAL, MissionPhase.LANDED])
@pytest.mark.parametrize("phase", SUBMITTED_PHASES)
def test_a_restart_forgets_no_mission(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    phase: MissionPhase,
    of_crowd: MissionPhase,
) -> None:
    """However many newer ones of others there are, over or not; it is found, and goes on."""
    rehearse = phase in {MissionPhase.SUBMITTED, MissionPhase.REHEARSING}
    served = unwatched(
        tmp_path,
        monkeypatch,
        rehearse=rehearse,
        approval=phase is MissionPhase.AWAITING_APPROVAL,
    )
    with closing(served):
        mission = reach(served, phase)
        crowded(served, of_crowd)
        # The processes of the service before go on, or have ended with it.
        served.started.clear()
        served.open()
        assert [one.id for one in served.missions.missions(PILOT)] == [mission.id]
        served.turns()
        assert served.phase(mission) is {
            MissionPhase.SUBMITTED: MissionPhase.REHEARSING,
            MissionPhase.QUEUED: MissionPhase.FLYING,
        }.get(phase, phase)
        if phase is MissionPhase.FLYING:
            lease = served.leases.request(CROWD, LeaseIn(robots=["one"]))
            served.turns()
            assert served.leases.lease(lease.id).state is LeaseState.QUEUED
            assert len({one.path.parent.name for one in served.started}) == 1, (
                "its own flight's alone"
            )


def test_missions_wait_in_the_order_of_their_submission(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after a restart: the first of those that share a lease flies first."""
    served = unwatched(tmp_path, monkeypatch, rehearse=False, most_flights=0)
    with closing(served):
        lease = served.leases.request(PILOT, LeaseIn(robots=["one"]))
        first, second = (served.submit("one", lease=lease.id) for _ in range(2))
        served.turns()
        served.settings = replace(served.settings, most_flights=16)
        served.open()
        served.turns()
        assert served.phase(first) is MissionPhase.FLYING
        assert served.phase(second) is MissionPhase.QUEUED


def test_no_flight_begins_on_a_drone_that_a_living_process_flies(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of which the database says nothing: no lease is granted, until that process is gone."""
    served = unwatched(tmp_path, monkeypatch, rehearse=False)
    with closing(served), held(served.settings.locks) as flight:
        mission, other = served.submit("one"), served.submit("two")
        served.turns()
        assert served.phase(mission) is MissionPhase.QUEUED
        lease = served.missions.shown(mission.id).lease
        assert lease is not None
        assert served.leases.lease(lease).state is LeaseState.QUEUED
        assert served.phase(other) is MissionPhase.FLYING
        flight.kill()
        flight.wait()
        served.turns()
        assert served.phase(mission) is MissionPhase.FLYING


def test_a_lease_that_is_held_already_starts_no_second_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits, and says for what."""
    served = unwatched(tmp_path, monkeypatch, rehearse=False)
    with closing(served):
        lease = served.leases.request(PILOT, LeaseIn(robots=["one"]))
        with held(served.settings.locks):
            mission = served.submit("one", lease=lease.id)
            served.turns()
            assert served.phase(mission) is MissionPhase.QUEUED
            assert "one" in served.missions.shown(mission.id).reason
        served.turns()
        assert served.phase(mission) is MissionPhase.FLYING


def test_a_drone_is_held_by_one_process(tmp_path: Path) -> None:
    """The second is refused by name, and holds none of its drones; a look disturbs nobody."""
    locks = RobotLocks(tmp_path / "locks")
    assert locks.held(["one", "two"]) == set()
    with held(tmp_path / "locks"):
        assert locks.held(["one", "two"]) == {"one"}
        with pytest.raises(MissionError, match="still flies one"), locks.hold(["two", "one"]):
            pass
        assert locks.held(["one", "two"]) == {"one"}
    with locks.hold(["one"]):
        assert locks.held(["one", "two"]) == {"one"}


def test_a_tenant_has_so_many_missions_that_are_not_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One more is refused until one is over; others' are not counted, and a repetition is none."""
    served = unwatched(tmp_path, monkeypatch, rehearse=False, most_open=2, approval=True)
    with closing(served):
        first, _ = served.submit("one", "k1"), served.submit("one", "k2")
        with pytest.raises(RefusedError, match="cancel some") as refused:
            served.submit("one")
        assert refused.value.status == 429
        assert served.submit("one", "k1").id == first.id
        assert len(list(served.settings.missions.iterdir())) == 2
        served.missions.cancel(PILOT, first.id)
        served.turns()
        assert served.submit("two").phase is MissionPhase.SUBMITTED


def ordered(folder: Path, **changes: object) -> FlightFolder:
    """The folder of a flight that is ordered for drone `one`."""
    path = folder / "fleet.json"
    path.write_text(json.dumps(fleet(robot("one"))), encoding="utf-8")
    made = FlightFolder(folder / "f")
    made.make(
        order_in(folder, ends=time.time() + 600, minutes=10, **changes),
        json.dumps(document("one", (5.0, 0.0))),
    )
    return made


def fly(folder: FlightFolder) -> str:
    """Run the process of a flight to its end; returns what it said."""
    command = [sys.executable, "-m", "aerodaas.flights", str(folder.path)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120).stderr


_WITHOUT_PLOTS = """
import os, sys
sys.modules["matplotlib"] = None  # as an installation without the extra `plots` has it
from pathlib import Path
from aerodaas.flights.rehearsal import rehearse
rehearse(Path(sys.argv[1]))
os._exit(0)
"""


def test_a_rehearsal_needs_no_plots(tmp_path: Path) -> None:
    """The extra `service` alone serves a fleet; only the picture is missing then."""
    made = ordered(tmp_path, speed="max", rehearsal=True)
    command = [sys.executable, "-c", _WITHOUT_PLOTS, str(made.path)]
    ended = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
    outcome = made.outcome()
    assert outcome is not None, ended.stderr
    assert outcome.verdict is not None
    assert outcome.verdict.approved, outcome.verdict.reasons
    assert not made.picture.exists()


def test_a_flight_that_is_cancelled_before_it_begins_is_not_launched(tmp_path: Path) -> None:
    """It ends as planned, with the reason, and has recorded nothing."""
    made = ordered(tmp_path)
    made.cancel("cancelled by pilot")
    fly(made)
    outcome = made.outcome()
    assert outcome is not None
    assert (outcome.landed, outcome.reason, outcome.status) == (True, "cancelled by pilot", {})
    assert not made.recording.exists()


def test_a_flight_of_a_drone_that_another_process_flies_does_not_begin(tmp_path: Path) -> None:
    """It may be begun once that one is over."""
    made = ordered(tmp_path)
    with RobotLocks(tmp_path / "locks").hold(["one"]):
        assert "still flies one" in fly(made)
    assert not made.begun

"""Hand-over of drones between the monitor and missions: never two that command, never nobody."""

from __future__ import annotations

import json
import time
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import pytest
from served import document, fleet, robot

from aerodaas.analytics.remote.schemas import StatusOut
from aerodaas.config.model import EnvironmentConfig
from aerodaas.protocol.schemas import LinkState, MissionIn, MissionOut, MissionPhase, Role, Scope
from aerodaas.service import mission as missions
from aerodaas.service.access import Principal, Quotas
from aerodaas.service.bookings import Bookings
from aerodaas.service.desk import MissionDesk
from aerodaas.service.errors import RefusedError
from aerodaas.service.fleet_view import FleetView
from aerodaas.service.flights.order import Outcome
from aerodaas.service.garage import Garage
from aerodaas.service.models import ModelShelf
from aerodaas.service.monitor.news import VehicleNews
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Account, Store, Tenant

PILOT = Principal("pilot", "farm", Role.PILOT, frozenset(Scope), "t")


class Monitor:
    """A monitor whose letting go a test decides."""

    def __init__(self, garage: Garage) -> None:
        self._garage = garage
        self._news: dict[str, VehicleNews] = {}
        self.wanted: set[str] = set()
        self.held: set[str] = set()

    def watch(self, robots: Collection[str]) -> None:
        """Hold these; what was held stays so until a test lets go of it."""
        self.wanted = set(robots)
        self.held |= self.wanted

    def released(self, robots: Collection[str]) -> bool:
        """Whether it holds none of these."""
        return self.held.isdisjoint(robots)

    def close(self) -> None:
        """Nothing."""

    def see(self, name: str, **changes: object) -> None:
        """Tell of one drone, as connected and fit but for the changes."""
        fit: dict[str, Any] = {"link": LinkState.CONNECTED, "heard": time.time(), "battery": 0.9}
        self._news[name] = VehicleNews(**{"held": True, **fit, **changes})
        self._garage.observe(self._news)


class Provider:
    """A desk with two drones, in whose flights a test is the process."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        path = folder / "fleet.json"
        path.write_text(json.dumps(fleet(robot("one"), robot("two", 10))), encoding="utf-8")
        self.started: list[Any] = []
        monkeypatch.setattr(missions, "start_process", lambda folder, **_: self._start(folder))
        config = EnvironmentConfig.load(path)
        settings = ServiceSettings(path, config, folder / "s", rehearse=False)
        settings.state.mkdir()
        self.store = Store.open(folder / "service.db")
        self.store.tenants.add(Tenant("farm"))
        self.store.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(Scope), 0.0))
        self.garage = Garage(config, self.store)
        self.bookings = Bookings(config, self.store, self.garage, Quotas(self.store))
        self.monitor = Monitor(self.garage)
        self.desk = MissionDesk(
            settings,
            self.store,
            bookings=self.bookings,
            garage=self.garage,
            models=ModelShelf(settings.models),
            monitor=self.monitor,  # type: ignore[arg-type] - what the desk calls of one
        )
        self.fleet = FleetView(config, {}, self.garage, self.bookings, self.desk)

    def _start(self, folder: Any) -> Any:  # noqa: ANN401
        self.started.append(folder)

        class Process:
            def poll(self) -> int | None:
                return None if folder.outcome() is None else 0

        return Process()

    def submit(self, name: str = "one") -> MissionOut:
        """Submit a mission for one drone."""
        content = {"document": document(name, (5, 0))}
        return self.desk.submit(PILOT, MissionIn.model_validate(content))

    def turns(self, count: int = 4) -> None:
        """Let the desk move on."""
        for _ in range(count):
            self.desk.turn()

    def phase(self, mission: MissionOut) -> MissionPhase:
        """Present phase of a mission."""
        return self.desk.shown(mission.id).phase

    def land(self, **changes: object) -> None:
        """End the newest flight, with its drone on the ground but for the changes."""
        numbers = ("time", "distance", "waypoints_visited", "waypoints_known")
        lists = ("pending", "visited", "given_up", "faults")
        content: dict[str, Any] = {"state": "landed", "reason": "", "target": None}
        content |= {"mode": "grounded", "battery": 0.7, **dict.fromkeys(numbers, 1)}
        status = StatusOut(**{**content, **{name: [] for name in lists}, **changes})
        self.started[-1].end(
            Outcome(landed=True, began=0.0, ended=1.0, status={"one": status}, reason="over")
        )


@pytest.fixture
def provider(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Provider]:
    """A provider whose monitor is the test's."""
    made = Provider(tmp_path, monkeypatch)
    yield made
    made.desk.close()
    made.store.close()


def test_a_flight_begins_once_the_monitor_has_let_go(provider: Provider) -> None:
    """Not before, and the monitor takes the drone back once the flight is over."""
    mission = provider.submit()
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}
    assert "the service connects to it" in provider.desk.shown(mission.id).reason
    provider.monitor.see("one")
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    assert provider.phase(mission) is MissionPhase.QUEUED
    assert provider.started == []
    provider.monitor.held.remove("one")
    provider.turns()
    assert provider.phase(mission) is MissionPhase.FLYING
    assert len(provider.started) == 1
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    assert provider.garage.news("one").link is LinkState.MISSION
    provider.land()
    provider.turns()
    assert provider.phase(mission) is MissionPhase.LANDED
    assert provider.monitor.wanted == {"one", "two"}


def test_one_that_somebody_arms_meanwhile_is_not_handed_over(provider: Provider) -> None:
    """The mission waits, and tells for what."""
    provider.monitor.see("one")
    mission = provider.submit()
    provider.turns()
    assert provider.monitor.wanted == {"two"}
    provider.monitor.see("one", mode="manual", objections=("already manual",))
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}
    assert provider.desk.shown(mission.id).reason == "waits for one: already manual"


@pytest.mark.parametrize(
    ("news", "said"),
    [
        (
            {"link": LinkState.LOST, "since": 1000.0, "reason": "no word"},
            "not reachable since 1970",
        ),
        ({"battery": 0.2}, "its battery holds 20%, and it comes home at 25%: charge it"),
        ({"objections": ("no fix", "hot")}, "no fix; hot"),
    ],
    ids=["unreachable", "low", "unhealthy"],
)
def test_what_cannot_fly_is_neither_leased_nor_submitted_to(
    provider: Provider, news: dict[str, Any], said: str
) -> None:
    """With the reason, which the catalogue has, too; another one can be had."""
    provider.monitor.see("one", **news)
    provider.monitor.see("two")
    for ask in (provider.submit, lambda: provider.bookings.request(PILOT, wish("one"))):
        with pytest.raises(RefusedError, match=r"^one: ") as refused:
            ask()
        assert refused.value.status == 409
        assert said in refused.value.text
    one, two = provider.fleet.seen_by(PILOT).robots
    assert said in one.objection
    assert (two.objection, two.link, two.battery) == ("", LinkState.CONNECTED, 0.9)
    any_one = provider.bookings.request(PILOT, wish())
    assert any_one.robots == ("two",)


def wish(*robots: str) -> Any:  # noqa: ANN401 - a request
    """A request of these drones, or of any one."""
    from aerodaas.protocol.schemas import LeaseIn  # noqa: PLC0415 - a request

    return LeaseIn(robots=list(robots) or None)


def test_a_dropout_of_a_moment_refuses_nobody(provider: Provider) -> None:
    """Radio links have them; the mission waits until it is over."""
    provider.monitor.see("one", link=LinkState.LOST, since=time.time())
    mission = provider.submit()
    provider.turns()
    assert "the service connects to it" in provider.desk.shown(mission.id).reason
    assert provider.monitor.wanted == {"one", "two"}


def test_one_that_is_not_known_to_be_down_is_nobodys(provider: Provider) -> None:
    """Its actor may fly it still: neither the monitor nor a mission connects before a look."""
    provider.monitor.see("one")
    mission = provider.submit()
    provider.turns()
    provider.monitor.held.clear()
    provider.turns()
    provider.land(state="aborted", mode="manual")
    provider.turns()
    assert "not known to be down" in provider.desk.shown(mission.id).reason
    assert provider.monitor.wanted == {"two"}
    with pytest.raises(RefusedError, match="out of service until an operator has looked"):
        provider.submit()
    provider.garage.enable("one", enabled=True)
    provider.turns()
    assert provider.monitor.wanted == {"one", "two"}


def test_drones_in_flight_are_left_alone_after_a_restart(provider: Provider) -> None:
    """A new service finds them in the database before it lets the monitor hold anything."""
    provider.monitor.see("one")
    provider.submit()
    provider.turns()
    provider.monitor.held.clear()
    provider.turns()
    assert len(provider.started) == 1
    seen: list[set[str]] = []
    monitor = Monitor(provider.garage)
    monitor.watch = lambda robots: seen.append(set(robots))  # type: ignore[method-assign]
    again = MissionDesk(
        provider.desk._settings,
        provider.store,
        bookings=provider.bookings,
        garage=provider.garage,
        models=ModelShelf(provider.desk._settings.models),
        monitor=monitor,  # type: ignore[arg-type]
    )
    again.turn()
    again.close()
    assert seen == [{"two"}]


def test_news_of_the_ground_do_not_hide_a_mission(provider: Provider) -> None:
    """The monitor tells of all drones, those that it does not hold included."""
    provider.garage.hand(["one"], LinkState.MISSION)
    provider.garage.observe({"one": VehicleNews(), "two": VehicleNews()})
    assert provider.garage.news("one").link is LinkState.MISSION
    provider.garage.observe({})
    assert provider.garage.news("one").link is LinkState.MISSION
    assert provider.garage.news("two").reason == "the service looks for it again"

"""A provider's service over two drones with cameras, whose monitor and flights are a test's own."""

from __future__ import annotations

import json
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any, cast

import pytest
from robot_statuses import robot_status
from served import document, fleet, robot

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.mission import MissionState
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.mission.commands import Answer
from aerodaas.protocol.schemas import (
    USUAL_SCOPES,
    FlightLeaseIn,
    LinkState,
    MissionIn,
    MissionOut,
    MissionPhase,
    Role,
    StreamKind,
)
from aerodaas.service import mission as missions
from aerodaas.service.access.principal import Principal
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.fleet.fleet_registry import FleetRegistry
from aerodaas.service.fleet.fleet_view import FleetView
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.leases.lease_service import LeaseService
from aerodaas.service.mission_service import MissionService
from aerodaas.service.models.model_store import ModelStore
from aerodaas.service.monitor.process import FleetMonitor
from aerodaas.service.monitor.reports import WatchedVehicle
from aerodaas.service.settings import ServiceSettings
from aerodaas.service.store import Account, Store, Tenant

SUBMITTED_PHASES = [
    phase for phase in MissionPhase if not phase.over and phase is not MissionPhase.PROPOSED
]
"""Phases of a mission that was submitted to be flown, until it is over."""
PILOT = Principal("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), "t")


class Monitor:
    """A monitor whose letting go a test decides."""

    def __init__(self, registry: FleetRegistry) -> None:
        self._registry = registry
        self._news: dict[str, WatchedVehicle] = {}
        self.wanted: set[str] = set()
        self.held: set[str] = set()

    def hold(self, robots: Collection[str]) -> None:
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
        self._news[name] = WatchedVehicle(**{"held": True, **fit, **changes})
        self._registry.record_reports(self._news)


class Link:
    """The link to a flight with two cameras that run; notes what it is asked."""

    def __init__(self) -> None:
        streams = dict.fromkeys(("one/cam", "one/belly"), StreamKind.PICTURES)
        self.mission = MissionOut(
            id="own",
            name="visits",
            tenant="own",
            account="own",
            phase=MissionPhase.FLYING,
            robots=["one"],
            submitted=0.0,
            streams={**streams, "one/found": StreamKind.DETECTIONS},
        )
        self.number = 1
        self.asked: list[Any] = []

    def change_lease(self, lease: FlightLeaseIn) -> Answer:
        """Accept."""
        return self._accept(lease)

    def share(self, mission: str, sensors: list[str]) -> Answer:
        """Accept."""
        return self._accept(("share", mission, sensors))

    def withdraw(self, mission: str) -> Answer:
        """Accept."""
        return self._accept(("withdraw", mission))

    def _accept(self, asked: object) -> Answer:
        self.asked.append(asked)
        return Answer(accepted=True)

    def record_presence(self) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


class Provider:
    """A service with two drones, in whose flights a test is the process."""

    def __init__(
        self,
        folder: Path,
        monkeypatch: pytest.MonkeyPatch,
        *,
        drone: dict[str, Any] | None = None,
        compute: list[dict[str, Any]] | None = None,
        simulation: dict[str, Any] | None = None,
        watched: bool = True,
        **settings: Any,  # noqa: ANN401
    ) -> None:
        path = folder / "fleet.json"
        robots = [one | (drone or {}) for one in (robot("one"), robot("two", 10))]
        for one in robots:
            one["sensors"] += [{"id": name, "type": "camera"} for name in ("cam", "belly")]
        content: dict[str, Any] = fleet(*robots)
        content |= {} if compute is None else {"compute": compute}
        content["simulation"] = {**content["simulation"], **(simulation or {})}
        path.write_text(json.dumps(content), encoding="utf-8")
        self.started: list[Any] = []
        monkeypatch.setattr(missions, "start_process", self._start)
        config = EnvironmentConfig.load(path)
        settings = {"rehearse": False, **settings}
        self.settings = ServiceSettings(path, config, folder / "s", **settings)
        self.settings.state.mkdir()
        self.store = Store.open(folder / "service.db")
        self.store.tenants.add(Tenant("farm"))
        self.store.accounts.add(Account("pilot", "farm", Role.PILOT, frozenset(USUAL_SCOPES), 0.0))
        self._watched = watched
        self.later = 0.0
        """Seconds by which approvals are older than they would be."""
        self.open()

    def open(self) -> None:
        """Open the service, as a service does when it starts."""
        config = self.settings.config
        self.registry = FleetRegistry(config, self.store)
        self.leases = LeaseService(config, self.store, self.registry, Quotas(self.store))
        self.monitor = Monitor(self.registry)
        self.missions = MissionService(
            self.settings,
            self.store,
            leases=self.leases,
            registry=self.registry,
            models=ModelStore(self.settings.models),
            monitor=cast("FleetMonitor", self.monitor) if self._watched else None,
            clock=lambda: time.monotonic() + self.later,
        )
        self.fleet = FleetView(
            config,
            {"robots": []},
            self.settings.actuators,
            self.registry,
            self.leases,
            self.missions,
            self.store,
        )

    def _start(self, folder: Any, *, tied: bool, vehicles: bool) -> Any:  # noqa: ANN401
        order = FlightOrder.read(folder.order)
        assert tied is order.rehearsal, "a flight outlives the service, no rehearsal does"
        flies = not order.rehearsal and order.attached is None
        assert vehicles is flies, "who flies gets the vehicles' secrets"
        self.started.append(folder)

        class Process:
            def poll(self) -> int | None:
                return None if folder.outcome() is None else 0

        return Process()

    def close(self) -> None:
        """Leave flights to themselves: the stand-in of a rehearsal has no id to be killed by."""
        if not self.settings.rehearse:
            self.missions.close()
        self.store.close()

    def submit(self, name: str = "one", key: str | None = None, **more: object) -> MissionOut:
        """Submit a mission for one drone."""
        content = {"document": document(name, (5, 0)), **more}
        return self.missions.submit(PILOT, MissionIn.model_validate(content), key)

    def flying(self, **more: object) -> MissionOut:
        """Submit a mission for drone `one`, and have it fly."""
        self.monitor.see("one")
        content = {"document": document("one", (5, 0)), **more}
        mission = self.missions.submit(PILOT, MissionIn.model_validate(content))
        self.turns(2)
        self.monitor.held.clear()
        self.missions._missions[mission.id].link = cast("Any", Link())
        self.turns()
        assert self.phase(mission) is MissionPhase.FLYING
        return mission

    def turns(self, count: int = 4) -> None:
        """Let the service move on."""
        for _ in range(count):
            self.missions.advance()

    def phase(self, mission: MissionOut) -> MissionPhase:
        """Present phase of a mission."""
        return self.missions.shown(mission.id).phase

    def land(self, **changes: object) -> None:
        """End the newest flight, with its drone on the ground but for the changes."""
        ended: dict[str, Any] = {"state": MissionState.LANDED, "mode": VehicleMode.GROUNDED}
        status = robot_status(**{**ended, "battery": 0.7, **changes})
        self.started[-1].end(
            Outcome(landed=True, began=0.0, ended=1.0, status={"one": status}, reason="over")
        )

"""Meter of a flight: its newest status and alerts, and what it has used."""

from __future__ import annotations

from collections import OrderedDict, defaultdict
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

from aerodaas.clock import host_time_ns, seconds
from aerodaas.messages.mission import GROUNDED
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import AnalyticsOut, StatusOut

if TYPE_CHECKING:
    from aerodaas.runtime.reports import ActorReport, FlightState

__all__ = ["FlightMeter"]

_Place: TypeAlias = tuple[float, float, float]
_ALERTS = 50
"""Most alerts told, the newest ones."""
_PLACES = 200
"""Most waypoints of a robot whose places are told, unless more lie ahead."""


class FlightMeter:
    """Newest status of each robot, and sums over the flight."""

    def __init__(self) -> None:
        self.status: dict[str, StatusOut] = {}
        """By robot; replaced and never changed, because other threads read it."""
        self.told: dict[str, float] = {}
        """Host time in seconds when each robot's newest status came; replaced as that is."""
        self.preflight: dict[str, PreflightOut] = {}
        """The list before take-off by robot; replaced as the status is."""
        self.alerts: list[str] = []
        self.analytics: AnalyticsOut | None = None
        """What the analytics scheduler has done; None before its first outcome."""
        self._places: dict[str, OrderedDict[str, _Place]] = defaultdict(OrderedDict)
        self._flown: dict[str, float] = defaultdict(float)
        self._charges: dict[str, tuple[float, float]] = {}
        """First and newest known charge by robot."""

    @property
    def time(self) -> float:
        """Mission seconds of the newest status."""
        return max((one.time for one in self.status.values()), default=0.0)

    def note(self, state: FlightState) -> None:
        """Take over a state of the run."""
        told = {}
        for name, report in state.robots.items():
            now, before = seconds(report.status.stamp), self.status.get(name)
            # The same status again is no news: who told it may hang.
            same = before is not None and before.time == now
            told[name] = self.told[name] if same else seconds(host_time_ns())
            if before is not None and report.status.state not in GROUNDED:
                self._flown[name] += max(0.0, now - before.time)
        self.told = told
        self.status = {
            name: self._remembering(name, StatusOut.of(report.status, report.state))
            for name, report in state.robots.items()
        }
        self.preflight = {
            name: PreflightOut.of_flight(name, report.health, report.status.stamp)
            for name, report in state.robots.items()
        }
        for name, status in self.status.items():
            if status.battery is not None:
                first, _ = self._charges.get(name, (status.battery, status.battery))
                self._charges[name] = first, status.battery
        self.alerts = [f"{one.kind}: {one.text}" for one in state.alerts[-_ALERTS:]]
        dispatcher = state.reports.get("dispatcher")
        if dispatcher is not None:
            self.analytics = AnalyticsOut.of(self.time, dispatcher.values)

    def _remembering(self, name: str, status: StatusOut) -> StatusOut:
        """A status with the places of waypoints that lie behind, too: those known last."""
        known = self._places[name]
        for waypoint, place in status.places.items():
            known[waypoint] = place
            known.move_to_end(waypoint)
        while len(known) > max(_PLACES, len(status.places)):
            known.popitem(last=False)
        return status.model_copy(update={"places": dict(known)})

    def usage(self, reports: Mapping[str, ActorReport]) -> dict[str, Any]:
        """What the flight has used, as `Outcome` has it; `reports` are its actors'."""
        compute: dict[str, float] = defaultdict(float)
        calls = 0
        for name, report in reports.items():
            kind, _, place = name.partition("/")
            if kind == "analytics" and report.vitals is not None:
                compute["cloud" if place == "cloud" else "edge"] += report.vitals.cpu_seconds
            if kind == "dispatcher":
                calls += sum(one["frames"] for one in report.values.get("sites", {}).values())
        return {
            "flight_seconds": sum(self._flown.values()),
            "distance": sum(one.distance for one in self.status.values()),
            "battery_used": sum(max(0.0, first - last) for first, last in self._charges.values()),
            "compute_seconds": dict(compute),
            "cloud_calls": calls,
        }

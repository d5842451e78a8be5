"""Check of one robot's waypoints against its limits, and the forecast of the way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from aerodaas.config.model import EnvironmentConfig, LimitsConfig, RobotConfig
from aerodaas.dataflow.mission_document import NavigationDocument
from aerodaas.documents.clearance import StandingObstacles
from aerodaas.documents.places import ROUNDING, PlaceCheck, as_triple, shown_place
from aerodaas.errors import AeroDaaSError, ConfigError, InvalidWaypointError
from aerodaas.geometry.energy import EnergyModel
from aerodaas.geometry.frames import Vector, length
from aerodaas.geometry.free_path import FreeArea
from aerodaas.messages.waypoints import HeightDatum, SchedulingType, Waypoint
from aerodaas.mission.commands import AddNavigation
from aerodaas.mission.navigation.navigator import Navigator
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.mission.rehearsal import known_ground, rehearse
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.protocol.proposals import CheckName, Finding, RobotForecast
from aerodaas.schedulers.trajectory.base import PlanningContext, TrajectoryScheduler

__all__ = ["RouteCheck"]

_DESCENT = 0.5
"""m/s of the landing, as in `EnergyModel.way_home`."""


@dataclass(frozen=True, slots=True)
class _Leg:
    """Straight or bent way to one place, and the stay there."""

    target: str
    """Id of the waypoint; empty for the way up and home."""
    points: Sequence[Vector]
    """Its corners, ENU metres."""
    distance: float
    seconds: float
    charge: float


@dataclass
class RouteCheck:
    """Check of one robot's navigation as a document has it; nothing flies.

    `run` gives the findings; `forecast` is complete after it.
    """

    robot: RobotConfig
    config: EnvironmentConfig
    entries: Sequence[NavigationDocument]
    """The document's navigation of this robot, in order."""
    scheduler: TrajectoryScheduler
    certain: bool = True
    """Whether the flight has this scheduler, so that it flies in the order that is planned here."""
    battery: float | None = None
    """Charge at the start, 0 to 1; None if it is not known, which counts as full."""
    minutes: float | None = None
    """Time within which the robot has to have landed; None for no limit."""
    forecast: RobotForecast = field(init=False)

    def __post_init__(self) -> None:
        """Begin with a forecast that knows the charge alone."""
        self.forecast = RobotForecast(robot=self.robot.id, battery=self.battery)

    def run(self) -> Iterator[Finding]:
        """All findings about the robot's places, way, charge and time."""
        try:
            fence, ground = Geofence(self._limits.geofence), self._ground
        except ConfigError as error:
            yield self._finding("document", f"limits.{error}", "have the provider mend its limits")
            return
        places = PlaceCheck(self.robot, self.config, self._start, fence, ground)
        admitted: list[tuple[AddNavigation, dict[str, Waypoint]]] = []
        found: list[Finding] = []
        for entry in self.entries:
            if entry.stream is not None or not entry.waypoints:
                continue
            try:
                navigation = entry.navigation()
            except InvalidWaypointError as error:
                found.append(self._finding("document", str(error), "mend this waypoint"))
                continue
            local, refused = places.resolve(navigation, entry.deadline)
            found += refused
            command = AddNavigation(navigation, entry.index, entry.deadline)
            admitted.append((command, local))
        yield from found
        if not found:
            found = list(self._refusals([command for command, _ in admitted]))
            yield from found
        yield from self._way_findings(fence, ground, admitted)

    @property
    def _limits(self) -> LimitsConfig:
        return self.robot.limits

    @cached_property
    def _start(self) -> Vector:
        return np.array(self.robot.start)

    @cached_property
    def _ground(self) -> GroundClearance | None:
        return known_ground(self.robot, self.config, self._start)

    @cached_property
    def _energy(self) -> EnergyModel:
        return EnergyModel(self._limits.endurance, np.array(self.config.simulation.wind))

    @property
    def _follows_stream(self) -> bool:
        return any(entry.stream is not None for entry in self.entries)

    def _finding(self, check: CheckName, text: str, remedy: str, **more: Any) -> Finding:  # noqa: ANN401 - fields of a finding
        return Finding(
            check=check, text=f"{self.robot.id}: {text}", remedy=remedy, robot=self.robot.id, **more
        )

    def _refusals(self, commands: Sequence[AddNavigation]) -> Iterator[Finding]:
        """Findings of the mission's own rehearsal that no other check has."""
        try:
            rehearse(self.robot, commands, self.config, self.scheduler)
        except AeroDaaSError as error:
            text = str(error).removeprefix(f"{self.robot.id}: ")
            yield self._finding("document", text, "mend this waypoint, or leave it out")

    def _way_findings(
        self,
        fence: Geofence,
        ground: GroundClearance | None,
        admitted: Sequence[tuple[AddNavigation, dict[str, Waypoint]]],
    ) -> Iterator[Finding]:
        """Findings about the way as a whole: its legs, charge, deadlines and length of time."""
        route = _Route(self.robot, fence, ground, self._start, self._energy)
        order = route.order(admitted, self.scheduler, self._charge)
        legs: list[_Leg] = []
        here = route.above_start
        for waypoint in order:
            leg = route.leg(here, waypoint)
            if leg is None:
                yield self._no_way(here, waypoint)
                return
            legs.append(leg)
            here = waypoint.position
        home = route.way_home(here)
        yield from self._deadline_findings(route, order, legs)
        yield from self._charge_findings(route, order, legs)
        yield from self._clearance_findings([*legs, home])
        seconds = route.climb.seconds + sum(leg.seconds for leg in (*legs, home))
        if self.minutes is not None and seconds > 60.0 * self.minutes:
            yield self._finding(
                "lease",
                f"the way takes {seconds:.0f} s, and the lease {60.0 * self.minutes:.0f} s",
                "fly fewer waypoints or faster, or ask for more minutes",
                measured=seconds,
                limit=60.0 * self.minutes,
                unit="s",
            )
        self._forecast(route, order, [route.climb, *legs, home])

    def _forecast(self, route: _Route, order: Sequence[Waypoint], legs: Sequence[_Leg]) -> None:
        decided = not self._follows_stream
        self.forecast = self.forecast.model_copy(
            update={
                "waypoints": len(order),
                "distance": sum(leg.distance for leg in legs) if decided else None,
                "seconds": sum(leg.seconds for leg in legs) if decided else None,
                "battery_used": sum(leg.charge for leg in legs) if decided else None,
                "highest": max((one.z for one in order), default=float(route.above_start[2])),
            }
        )

    @property
    def _charge(self) -> float:
        return 1.0 if self.battery is None or math.isnan(self.battery) else self.battery

    def _no_way(self, here: Vector, waypoint: Waypoint) -> Finding:
        zones = bool(self._limits.geofence.no_fly)
        return self._finding(
            "no_fly" if zones else "fence",
            f"no way within the fence leads from {shown_place(here)} to {waypoint.id!r} at "
            f"{shown_place(waypoint.position)}",
            "leave the waypoint out: it lies in another part of the fence",
            waypoint=waypoint.id,
            place=as_triple(waypoint.position),
        )

    def _deadline_findings(
        self, route: _Route, order: Sequence[Waypoint], legs: Sequence[_Leg]
    ) -> Iterator[Finding]:
        """Deadlines that the way as planned misses, or that not even the straight way meets."""
        ended = route.climb.seconds
        for waypoint, leg in zip(order, legs, strict=True):
            reach = self._limits.arrival_radius / self._limits.max_speed
            ended += leg.seconds
            arrival, way = ended - waypoint.hover_duration - reach, "by the planned way"
            if not self.certain:
                climb = float(waypoint.position[2] - route.above_start[2])
                direct = length(waypoint.position - route.above_start)
                arrival = route.climb.seconds + route.seconds(direct, climb, waypoint) - reach
                way = "by the straight way"
            if waypoint.deadline is not None and arrival > waypoint.deadline:
                yield self._finding(
                    "deadline",
                    f"{waypoint.id!r} is reached after {arrival:.0f} s {way}, and its "
                    f"deadline is {waypoint.deadline:g} s",
                    "fly there earlier or faster, or give it a deadline of "
                    f"{math.ceil(arrival)} s or more",
                    waypoint=waypoint.id,
                    place=as_triple(waypoint.position),
                    measured=arrival,
                    limit=waypoint.deadline,
                    unit="s",
                )

    def _charge_findings(
        self, route: _Route, order: Sequence[Waypoint], legs: Sequence[_Leg]
    ) -> Iterator[Finding]:
        """The first place at which the drone would return instead of flying on."""
        limits = self._limits
        if self._charge <= limits.battery_return:
            yield self._finding(
                "battery",
                f"its charge is {self._charge:.0%}, and it takes off with more than "
                f"{limits.battery_return:.0%}",
                "have the battery charged",
                measured=100.0 * self._charge,
                limit=100.0 * limits.battery_return,
                unit="%",
            )
            return
        left = self._charge - route.climb.charge
        for waypoint, leg in zip(order, legs, strict=True):
            left -= leg.charge
            way_home = self._energy.way_home(waypoint.position, self._start, route.cruise)
            needed = max(limits.battery_return, limits.battery_land + way_home)
            if left < needed - ROUNDING:
                yield self._finding(
                    "battery",
                    f"at {waypoint.id!r} {max(0.0, left):.0%} of the charge is left, and the drone "
                    f"returns at {needed:.0%}",
                    "fly fewer waypoints, faster or nearer to home, or have the battery charged",
                    waypoint=waypoint.id,
                    place=as_triple(waypoint.position),
                    measured=100.0 * left,
                    limit=100.0 * needed,
                    unit="%",
                )
                return

    def _clearance_findings(self, legs: Sequence[_Leg]) -> Iterator[Finding]:
        """Places of the way that are too near to what stands in the simulated world."""
        if self.robot.driver != "simulated":
            return
        try:
            obstacles = StandingObstacles(self.config.simulation)
        except ConfigError as error:
            yield self._finding("document", f"simulation.{error}", "have the provider mend it")
            return
        for leg in legs:
            for one in obstacles.along(leg.points):
                thing = one.nearest
                towards = f"to {leg.target!r}" if leg.target else "home"
                yield self._finding(
                    "clearance",
                    f"the way {towards} comes to {thing.distance:.1f} m from the {thing.label} "
                    f"{thing.thing} at {shown_place(one.place)}, and {one.limit:g} m are kept",
                    "fly around it or higher, by a waypoint more",
                    waypoint=leg.target or None,
                    place=as_triple(one.place),
                    measured=thing.distance,
                    limit=one.limit,
                    unit="m",
                )


class _Route:
    """The way of one robot: order of its waypoints, and distance, time and charge of each leg."""

    def __init__(
        self,
        robot: RobotConfig,
        fence: Geofence,
        ground: GroundClearance | None,
        start: Vector,
        energy: EnergyModel,
    ) -> None:
        self._robot = robot
        self._fence = fence
        self._ground = ground
        self._start = start
        self._energy = energy
        self._free = None if fence.inner is None else FreeArea(fence.inner)
        limits = robot.limits
        self.cruise = min(limits.cruise_speed, limits.max_speed)
        up = limits.takeoff_height
        self.above_start = start + np.array([0.0, 0.0, up])
        climb = energy.leg(start, self.above_start, limits.max_climb)
        self.climb = _Leg("", (start, self.above_start), up, up / limits.max_climb, climb)

    def order(
        self,
        admitted: Sequence[tuple[AddNavigation, Mapping[str, Waypoint]]],
        scheduler: TrajectoryScheduler,
        charge: float,
    ) -> list[Waypoint]:
        """Waypoints in the order flown."""
        limits = self._robot.limits
        navigator = Navigator(
            InlinePlanner(scheduler),
            self._fence,
            home=self._start,
            max_range=limits.max_range,
            origin=None,
            datum=HeightDatum(),
            clearance=self._ground,
            command_timeout=limits.command_timeout,
            resume_after=self._robot.mission.resume_after,
        )
        queued: set[str] = set()
        for number, (command, local) in enumerate(admitted):
            fresh = [one for key, one in local.items() if key not in queued]
            queued |= set(local)
            ordered = command.navigation.scheduling_type is SchedulingType.ORDERED
            navigator.add(
                fresh,
                group=f"group {number}" if ordered else None,
                index=command.index,
                above_ground={},
            )
        order: list[Waypoint] = []
        here, now = self.above_start, self.climb.seconds
        while (stop := navigator.queue.head) is not None:
            situation = PlanningContext(
                now,
                here,
                self._start,
                charge,
                limits.cruise_speed,
                energy=self._energy,
                reserve=limits.battery_land,
            )
            navigator.plan(situation)
            stop = navigator.queue.head
            if stop is None:
                break
            order.append(stop.waypoint)
            way = stop.waypoint.position - here
            now += self.seconds(length(way), float(way[2]), stop.waypoint)
            now += stop.waypoint.hover_duration
            here = stop.waypoint.position
            navigator.finish(stop)
        return order

    def seconds(self, distance: float, up: float, waypoint: Waypoint) -> float:
        """Least time to a waypoint, seconds.

        Args:
            distance: Of the way, metres.
            up: Metres that it climbs.
            waypoint: Where it leads, which may have a speed.
        """
        return max(distance / self._speed(waypoint), up / self._robot.limits.max_climb)

    def leg(self, here: Vector, waypoint: Waypoint) -> _Leg | None:
        """The way to a waypoint and the stay there; None if none lies within the fence.

        Args:
            here: Where it begins, ENU metres.
            waypoint: Where it ends.
        """
        there = waypoint.position
        corners = self._corners(here, there)
        if corners is None:
            return None
        speed = self._speed(waypoint)
        points = [here, *(np.array([*corner, there[2]]) for corner in corners[1:-1]), there]
        pairs = list(pairwise(points))
        distance = sum(length(end - begin) for begin, end in pairs)
        stay = waypoint.hover_duration
        charge = sum(self._energy.leg(*pair, speed) for pair in pairs) + self._energy.hover(stay)
        seconds = self.seconds(distance, float(there[2] - here[2]), waypoint) + stay
        return _Leg(waypoint.id, points, distance, seconds, charge)

    def way_home(self, here: Vector) -> _Leg:
        """The way to above the start, and the landing there."""
        above = np.array([self._start[0], self._start[1], here[2]])
        corners = self._corners(here, above) or [(here[0], here[1]), (above[0], above[1])]
        points = [np.array([*corner, here[2]]) for corner in corners]
        level = sum(length(end - begin) for begin, end in pairwise(points))
        down = max(0.0, float(here[2] - self._start[2]))
        seconds = level / self.cruise + down / _DESCENT
        charge = self._energy.way_home(here, self._start, self.cruise)
        return _Leg("", points, level + down, seconds, charge)

    def _speed(self, waypoint: Waypoint) -> float:
        return min(waypoint.speed or self.cruise, self._robot.limits.max_speed)

    def _corners(self, here: Vector, there: Vector) -> list[tuple[float, float]] | None:
        begin, end = (float(here[0]), float(here[1])), (float(there[0]), float(there[1]))
        if self._free is None:
            return [begin, end]
        # A drone may stand nearer to the edge than it flies.
        inside = self._fence.nearest_allowed(here)
        way = self._free.path((float(inside[0]), float(inside[1])), end)
        return None if way is None else [begin, *way[1:]]

"""Choice of the next target: the queue of waypoints, its plans, and the live velocity command."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace

from aerodaas.clock import NANOSECONDS
from aerodaas.geometry.frames import GeodeticOrigin, Vector
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import HeightDatum, VelocityCommand, Waypoint
from aerodaas.mission.navigation.planner import Plan, Planner, PlanRequest
from aerodaas.mission.navigation.queue import QueuedWaypoint, WaypointQueue
from aerodaas.mission.safety.geofence import Geofence
from aerodaas.mission.safety.ground_clearance import GroundClearance
from aerodaas.schedulers.trajectory.base import PlanningContext

__all__ = ["LiveCommand", "Navigator"]


@dataclass(frozen=True, slots=True)
class LiveCommand:
    """A velocity command received in flight."""

    command: VelocityCommand
    expires: int
    """Mission clock at which it expires, nanoseconds."""
    cause: Header | None = None


class Navigator:
    """The navigation of one drone: queue and live command, independent of the mission's state."""

    def __init__(
        self,
        planner: Planner,
        fence: Geofence,
        *,
        home: Vector,
        max_range: float,
        origin: GeodeticOrigin | None,
        datum: HeightDatum,
        clearance: GroundClearance | None,
        command_timeout: float,
        resume_after: float,
        objection: Callable[[Waypoint], str] = lambda _: "",
    ) -> None:
        """Plan with `planner` inside `fence`; `home` is the place of take-off, ENU metres.

        `objection` says why an action of a waypoint is not possible; empty if it can.
        """
        self.queue = WaypointQueue()
        self.command: LiveCommand | None = None
        self.fault = ""
        """The scheduler's latest fault."""
        self._planner = planner
        self._fence = fence
        self._home = home
        self._max_range = max_range
        self._origin = origin
        self._datum = datum
        self._clearance = clearance
        self._command_timeout = command_timeout
        self._action_objection = objection
        self._resume_after = round(resume_after * NANOSECONDS)
        self._unplanned: set[int] = set()
        self._unanswered: PlanRequest | None = None

    def admit(
        self, waypoints: Iterable[Waypoint], now: float, deadline: float | None, source: str
    ) -> tuple[list[Waypoint], dict[str, str]]:
        """Resolve waypoints to local ENU.

        Args:
            waypoints: Waypoints in any of their frames.
            now: Mission time, seconds.
            deadline: Mission time by which all are to be reached, seconds; None for their own only.
            source: Who queues them; empty for the application.

        Returns:
            The flyable waypoints, and the reasons for the others by id.
        """
        taken: list[Waypoint] = []
        refused: dict[str, str] = {}
        for asked in waypoints:
            try:
                waypoint = asked.resolve(self._home, self._origin, self._datum)
            except ValueError as error:
                refused[asked.id] = str(error)
                continue
            limits = [limit for limit in (waypoint.deadline, deadline) if limit is not None]
            waypoint = replace(waypoint, deadline=min(limits, default=None))
            objection = self._objection(waypoint, now, source)
            if objection:
                refused[asked.id] = f"waypoint {asked.id!r}: {objection}"
            else:
                taken.append(waypoint)
        return taken, refused

    def _objection(self, waypoint: Waypoint, now: float, source: str) -> str:
        distance = float(((waypoint.position - self._home) ** 2).sum() ** 0.5)
        if distance > self._max_range:
            most = f"{self._max_range:g} m (limits.max_range)"
            return f"{distance:.0f} m away is beyond the range of {most}"
        if waypoint.deadline is not None and waypoint.deadline <= now:
            return f"its deadline of {waypoint.deadline:g} s is past, it is {now:.1f} s now"
        known = self.queue.find(waypoint.id)
        if known is not None and (not source or known.source != source):
            return "a waypoint of this id is already queued; use another id"
        if objection := self._action_objection(waypoint):
            return objection
        if objection := self._fence.objection(waypoint.position):
            return objection
        return self._clearance.objection(waypoint.position) if self._clearance else ""

    def add(
        self,
        waypoints: list[Waypoint],
        *,
        group: str | None = None,
        index: int | None = None,
        source: str = "",
        cause: Header | None = None,
        above_ground: Mapping[str, float],
    ) -> None:
        """Queue admitted waypoints and request a plan.

        Args:
            waypoints: Waypoints in local ENU, as `admit` returns them.
            group: Key of the group whose order is kept; None for none.
            index: Number of stops of their list that they follow; None for the end, to be planned.
            source: Who queues them; empty for the application.
            cause: Header of the item from which they were generated.
            above_ground: Metres to keep above the ground on the way to a waypoint, by its id.

        Raises:
            InvalidWaypointError: If an id is already queued by another source, or the index is
                negative.
        """
        self.queue.add(
            waypoints,
            group=group,
            index=index,
            source=source,
            cause=cause,
            above_ground=above_ground,
        )
        if index is None:
            self._unplanned |= {waypoint.priority for waypoint in waypoints}

    def obey(self, command: VelocityCommand, now: int, cause: Header | None) -> None:
        """Store a velocity command, unless a more urgent one has not expired.

        Args:
            command: Velocity in the body frame, with its priority and how long it is valid.
            now: Mission clock, nanoseconds.
            cause: Header of the item from which it was generated.
        """
        present = self.command
        if present and now < present.expires and present.command.priority < command.priority:
            return
        valid_for = round(min(command.valid_for, self._command_timeout) * NANOSECONDS)
        self.command = LiveCommand(command, now + valid_for, cause)

    def clear(self) -> list[str]:
        """Discard all queued and interrupted waypoints and the live command; returns the ids."""
        self.command = None
        self._unanswered = None
        self._unplanned.clear()
        return self.queue.clear()

    def finish(self, stop: QueuedWaypoint) -> None:
        """Remove a visited stop."""
        self.queue.remove(stop.id)
        if self._planner.replans_on_arrival:
            self._unplanned.add(stop.waypoint.priority)

    def served(self, now: int) -> QueuedWaypoint | LiveCommand | None:
        """Return the target at `now`: the more urgent of stop and command, the stop in a tie.

        A command keeps its turn for `resume_after` after it has expired, so that a gap in the
        stream does not send the drone back to its plan.
        """
        stop, live = self.queue.head, self.command
        if live is not None and now >= live.expires + self._resume_after:
            live = None
        if stop is None or (live is not None and live.command.priority < stop.waypoint.priority):
            return live
        return stop

    @property
    def waits_for_plan(self) -> bool:
        """Whether a plan for the list being served has been requested and has not arrived."""
        return self._unanswered is not None and self._unanswered.level == self.queue.level

    @property
    def following(self) -> QueuedWaypoint | None:
        """The stop that follows the one being served; None where a plan may change that."""
        planned = self.queue.level not in self._unplanned and not self.waits_for_plan
        certain = planned and not self._planner.replans_on_arrival
        return self.queue.following if certain else None

    def plan(self, situation: PlanningContext) -> list[str] | None:
        """Request a plan if one is due, and apply one that has arrived.

        Returns the ids that the plan gives up, or None if no plan has arrived.
        """
        level = self.queue.level
        if level in self._unplanned:
            self._unplanned.remove(level)
            stops = self.queue.movable()
            if stops:
                request = PlanRequest(
                    self.queue.epoch,
                    level,
                    tuple(stop.waypoint for stop in stops),
                    replace(situation, ordered=_groups(stops)),
                )
                self._unanswered = request
                self._planner.submit(request)
        plan = self._planner.poll()
        return None if plan is None else self._adopt(plan)

    def _adopt(self, plan: Plan) -> list[str]:
        request = plan.request
        if request is self._unanswered:
            self._unanswered = None
        if request.epoch != self.queue.epoch:
            return []
        self.fault = plan.fault
        asked = [waypoint.id for waypoint in request.pending]
        return self.queue.reorder(request.level, asked, [waypoint.id for waypoint in plan.order])


def _groups(stops: list[QueuedWaypoint]) -> tuple[tuple[str, ...], ...]:
    groups: dict[str, list[str]] = {}
    for stop in stops:
        if stop.group is not None:
            groups.setdefault(stop.group, []).append(stop.id)
    return tuple(tuple(ids) for ids in groups.values() if len(ids) > 1)

"""The queue of waypoints: priorities, groups that keep their order, preemption without loss.

Each priority has its own list, and the most urgent non-empty list is served. A preempted list keeps
its place: the waypoint that was under way stays at its head with its remaining hover time, so that
an interrupted plan resumes where it was left. There is no other store; emptying the queue therefore
discards interrupted plans too.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from aerodaas.errors import InvalidWaypointError
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import Waypoint

__all__ = ["QueuedWaypoint", "WaypointQueue"]


_STRAIGHT: Mapping[str, float] = {}


@dataclass(slots=True, eq=False)
class QueuedWaypoint:
    """A waypoint in the queue and its progress."""

    waypoint: Waypoint
    group: str | None = None
    """Stops of one group keep their order."""
    pinned: bool = False
    """Put at an index by the application: planning moves other stops around it."""
    source: str = ""
    """Stream that it came from; empty for none."""
    cause: Header | None = None
    """Header of the measurement that it was made from."""
    remaining_hover: float = 0.0
    """Seconds left to hover."""
    under_way: bool = False
    """The drone has set out for it."""
    arrived: bool = False
    """The drone has arrived and hovers there."""
    above_ground: float | None = None
    """Metres above the ground to keep on the way there; None flies straight."""

    @property
    def id(self) -> str:
        """The waypoint's id."""
        return self.waypoint.id


class WaypointQueue:
    """Waypoints in local ENU, ordered by priority."""

    def __init__(self) -> None:
        """Start empty."""
        self._levels: dict[int, list[QueuedWaypoint]] = {}
        self.epoch = 0
        """Number of times that the queue was emptied; a plan of an older epoch is void."""

    def add(
        self,
        waypoints: Iterable[Waypoint],
        *,
        group: str | None = None,
        index: int | None = None,
        source: str = "",
        cause: Header | None = None,
        above_ground: Mapping[str, float] = _STRAIGHT,
    ) -> None:
        """Queue `waypoints`, each in the list of its priority; nothing is queued after an error.

        A waypoint with the id of one that the same `source` (not the empty one) queued replaces it:
        its target has moved.

        Args:
            waypoints: Waypoints in local ENU.
            group: Key of the group whose order plans keep; None for none.
            index: Number of stops of their list that they follow, and stay there; None for the end.
            source: Who queues them; empty for the application.
            cause: Header of the item from which they were generated.
            above_ground: Metres to keep above the ground on the way to a waypoint, by its id.

        Raises:
            InvalidWaypointError: If an id is already queued by another source, or the index is
                negative.
        """
        arriving = list(waypoints)
        queued = {stop.id: stop for stop in self}
        self._check(arriving, queued, index, source)
        offset: dict[int, int] = {}
        for waypoint in arriving:
            stop = QueuedWaypoint(
                waypoint,
                group,
                index is not None,
                source,
                cause,
                waypoint.hover_duration,
                above_ground=above_ground.get(waypoint.id),
            )
            known = queued.get(waypoint.id)
            if known is not None and known.waypoint.priority == waypoint.priority:
                level = self._levels[waypoint.priority]
                stop.under_way = known.under_way
                level[level.index(known)] = stop
                continue
            if known is not None:
                self.remove(known.id)
            level = self._levels.get(waypoint.priority, [])
            if index is None:
                level.append(stop)
            else:
                # An index comes from remote users, and may be larger than a list can count.
                place = min(index + offset.get(waypoint.priority, 0), len(level))
                offset[waypoint.priority] = offset.get(waypoint.priority, 0) + 1
                level.insert(place, stop)
                self._withdraw(level[1:])
            self._levels[waypoint.priority] = level

    @staticmethod
    def _check(
        arriving: list[Waypoint],
        queued: Mapping[str, QueuedWaypoint],
        index: int | None,
        source: str,
    ) -> None:
        if index is not None and index < 0:
            message = f"an index counts from the next waypoint and is not negative, not {index}"
            raise InvalidWaypointError(message)
        seen: set[str] = set()
        for waypoint in arriving:
            known = queued.get(waypoint.id)
            taken = known is not None and (not source or known.source != source)
            if taken or waypoint.id in seen:
                message = f"a waypoint called {waypoint.id!r} is already queued; use another id"
                raise InvalidWaypointError(message)
            seen.add(waypoint.id)

    @property
    def level(self) -> int | None:
        """Priority of the list being served; None when the queue is empty."""
        return min(self._levels, default=None)

    @property
    def head(self) -> QueuedWaypoint | None:
        """The stop to serve now."""
        return self._levels[min(self._levels)][0] if self._levels else None

    @property
    def following(self) -> QueuedWaypoint | None:
        """The stop after the head in the same list; None if it is the last one there."""
        stops = self._ordered_levels()[0] if self._levels else []
        return stops[1] if len(stops) > 1 else None

    @property
    def interrupted(self) -> bool:
        """Whether a less urgent list with a stop under way waits."""
        return any(stop.under_way for stops in self._ordered_levels()[1:] for stop in stops)

    def __iter__(self) -> Iterator[QueuedWaypoint]:
        """Iterate over the stops in their current order of service."""
        for stops in self._ordered_levels():
            yield from stops

    def __len__(self) -> int:
        """Count the stops."""
        return sum(map(len, self._levels.values()))

    def find(self, waypoint_id: str) -> QueuedWaypoint | None:
        """Return the stop of this id; None if it is not queued."""
        return next((stop for stop in self if stop.id == waypoint_id), None)

    def remove(self, waypoint_id: str) -> QueuedWaypoint | None:
        """Remove and return a served or abandoned stop; None if it is not queued."""
        for priority, stops in self._levels.items():
            for stop in stops:
                if stop.id == waypoint_id:
                    stops.remove(stop)
                    if not stops:
                        del self._levels[priority]
                    return stop
        return None

    def clear(self) -> list[str]:
        """Empty the queue and return the removed ids."""
        forgotten = [stop.id for stop in self]
        self._levels.clear()
        self.epoch += 1
        return forgotten

    def leave_place(self) -> None:
        """Mark that the drone has left its stop; remaining hover times are kept."""
        self._withdraw(self)

    def movable(self) -> list[QueuedWaypoint]:
        """Stops of the list being served that a plan may reorder."""
        level = self._ordered_levels()[0] if self._levels else []
        return [stop for stop in level if not (stop.pinned or stop.arrived)]

    def reorder(self, level: int, asked: Iterable[str], order: Sequence[str]) -> list[str]:
        """Put the `level` list into the planned `order`.

        Groups keep their internal order in the places that the plan gives to the group; pinned
        stops keep their index.

        Args:
            level: Priority of the list.
            asked: Ids that the plan was made for; stops queued since follow behind.
            order: Ids in the planned order; one of `asked` that it leaves out is given up.

        Returns:
            The ids given up.
        """
        stops = self._levels.get(level, [])
        free = {stop.id: stop for stop in stops if not (stop.pinned or stop.arrived)}
        wanted = set(order)
        given_up = [key for key in asked if key in free and key not in wanted]
        planned = [free[key] for key in order if key in free]
        for key in (*order, *given_up):
            free.pop(key, None)
        planned = self._keep_groups([*planned, *free.values()], stops)
        kept = [stop for stop in stops if stop.id not in given_up]
        moved = iter(planned)
        fixed = {index: stop for index, stop in enumerate(stops) if stop.pinned or stop.arrived}
        result: list[QueuedWaypoint] = []
        while len(result) < len(kept):
            stop = fixed.pop(len(result), None) or next(moved, None)
            result.append(stop if stop is not None else fixed.pop(min(fixed)))
        if result:
            self._levels[level] = result
        else:
            self._levels.pop(level, None)
        return given_up

    def rearrange(self, order: Sequence[str], remove: Iterable[str]) -> None:
        """Have stops change places among themselves, and remove others; all or nothing.

        Args:
            order: Ids of stops, which stay in their new places, around which plans move the others.
            remove: Ids of stops to remove.

        Raises:
            InvalidWaypointError: If priorities contradict the order.
        """
        stops = [stop for key in order if (stop := self.find(key)) is not None]
        for before, after in pairwise(stops):
            if before.waypoint.priority > after.waypoint.priority:
                raise InvalidWaypointError(
                    f"{after.id!r} is more urgent than {before.id!r}, so it comes first: only "
                    "waypoints of one priority change places"
                )
        for key in remove:
            self.remove(key)
        named = set(stops)
        for level in self._levels.values():
            moved = iter([stop for stop in stops if stop in set(level)])
            level[:] = [next(moved) if stop in named else stop for stop in level]
        for stop in stops:
            stop.pinned = True

    @staticmethod
    def _keep_groups(
        planned: list[QueuedWaypoint], stops: list[QueuedWaypoint]
    ) -> list[QueuedWaypoint]:
        chosen = set(planned)
        members: dict[str, Iterator[QueuedWaypoint]] = {
            group: iter([stop for stop in stops if stop.group == group and stop in chosen])
            for group in {stop.group for stop in planned if stop.group is not None}
        }
        return [next(members[stop.group]) if stop.group else stop for stop in planned]

    def _ordered_levels(self) -> list[list[QueuedWaypoint]]:
        return [self._levels[priority] for priority in sorted(self._levels)]

    @staticmethod
    def _withdraw(stops: Iterable[QueuedWaypoint]) -> None:
        for stop in stops:
            stop.arrived = False

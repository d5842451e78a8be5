"""Mission documents written by code, as a model would write them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

from aerodaas.dataflow.mission_document import MissionDocument
from agent_tasks.criteria import Leg, Place

__all__ = ["Stop", "document", "legs", "ring", "stop", "turned"]

Stop: TypeAlias = dict[str, Any]
"""Fields of a waypoint without its id."""


def stop(place: Place, heading: float | None = None, hover: float = 0.0, **fields: object) -> Stop:
    """A waypoint.

    Args:
        place: Metres east, north and up of home.
        heading: Degrees counter-clockwise from east; None keeps the direction of flight.
        hover: Seconds to stay.
        fields: Further fields of the waypoint.
    """
    yaw = {} if heading is None else {"yaw": math.radians(heading)}
    x, y, z = place
    return {"x": x, "y": y, "z": z, "hover_duration": hover, **yaw, **fields}


def document(robot: str, stops: Iterable[Stop], **parts: object) -> MissionDocument:
    """A document by which a robot visits stops in order.

    Args:
        robot: Id of the robot.
        stops: Waypoints without ids.
        parts: Further parts of the document; `navigation` holds fields of the stops' entry.
    """
    fields = parts.pop("navigation", {})
    waypoints = [{"id": f"wp{number}", **one} for number, one in enumerate(stops, start=1)]
    navigation = [{"robot": robot, "waypoints": waypoints, **dict(fields)}]  # type: ignore[call-overload]
    head = {"format": "aerodaas-mission", "version": 1, "navigation": navigation}
    return MissionDocument.model_validate({**head, **parts})


def legs(start: Place, places: Sequence[Place], turn: float | Sequence[float] = 0.0) -> list[Leg]:
    """The legs from a start through places.

    Args:
        start: Where the first leg begins.
        places: Ends of the legs.
        turn: Degrees counter-clockwise from the direction of flight to the nose, of all legs or
            each.
    """
    turns = turn if isinstance(turn, Sequence) else [turn] * len(places)
    return [
        Leg(a, b, math.degrees(math.atan2(b[1] - a[1], b[0] - a[0])) + angle)
        for (a, b), angle in zip(itertools.pairwise((start, *places)), turns, strict=True)
    ]


def turned(way: Iterable[Leg]) -> list[Stop]:
    """Stops along legs: at each start the drone turns to the leg's heading before it goes on."""
    return [
        one for leg in way for one in (stop(leg.start, leg.heading), stop(leg.end, leg.heading))
    ]


def ring(
    centre: tuple[float, float], radius: float, height: float, count: int, first: float
) -> list[Place]:
    """Places on a circle, counter-clockwise, closed.

    Args:
        centre: Metres east and north.
        radius: Metres.
        height: Metres up.
        count: Places.
        first: Degrees counter-clockwise from east of the first and last place.
    """
    angles = [math.radians(first + 360.0 * number / count) for number in range(count + 1)]
    east, north = centre
    return [
        (east + radius * math.cos(angle), north + radius * math.sin(angle), height)
        for angle in angles
    ]

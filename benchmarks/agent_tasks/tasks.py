"""The 25 tasks: request, truth, a document that fulfils it, and one that nearly does.

A near miss is a mistake that models make: the mirror image, another frame, one corner short, the
nose turned the wrong way. It must fail exactly the checks named, and no other.

Words of the body's frame ("ahead", "left") are resolved by the documents, which know places of the
local frame alone; "at first" the drone looks as the request says.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, TypeAlias

from missions.catalogue import APPS, MISSIONS
from missions.criteria import Criterion

from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.environment.document.flying import compile_application
from agent_tasks.criteria import (
    ALWAYS,
    Gap,
    Place,
    arrivals,
    at,
    between,
    coverage,
    encircled,
    hexagon,
    inspected,
    look,
    nose,
    nose_at,
    outline,
    outside,
    returned,
    short_way,
    stays,
)
from agent_tasks.documents import Stop, document, legs, ring, stop, turned

__all__ = ["TASKS", "Task"]

Make: TypeAlias = Callable[[], MissionDocument]
Content: TypeAlias = dict[str, Any]
"""JSON of a part of a document."""

_EAST, _NORTH, _WEST, _SOUTH = 0.0, 90.0, 180.0, -90.0
_BASE = "quadrotor_base"


@dataclass(frozen=True)
class Task:
    """One request and how a flight that answers it is judged."""

    name: str
    environment: str
    """Of the applications'."""
    request: str
    truth: tuple[Criterion, ...]
    solution: Make
    miss: Make
    mistake: str
    """What is wrong with the near miss."""
    fails: tuple[str, ...]
    """First words of the checks that the near miss must fail."""
    changes: Mapping[str, object] = field(default_factory=dict)
    """Settings of the environment, by dotted name."""
    always: tuple[Criterion, ...] = ALWAYS
    networks: bool = False
    """Whether neural networks run, which take minutes."""

    @property
    def criteria(self) -> tuple[Criterion, ...]:
        """All that a flight must fulfil."""
        return (*self.truth, *self.always)


def _flown(stops: Sequence[Stop], robot: str = _BASE, **parts: object) -> Make:
    return partial(document, robot, stops, **parts)


def _through(*places: Place, robot: str = _BASE, **parts: object) -> Make:
    return _flown([stop(place) for place in places], robot, **parts)


def _level(height: float, *places: tuple[float, float]) -> tuple[Place, ...]:
    return tuple((x, y, height) for x, y in places)


def _moved(places: Sequence[Place], east: float, north: float, up: float) -> tuple[Place, ...]:
    return tuple((x + east, y + north, z + up) for x, y, z in places)


def _mirrored(places: Sequence[Place]) -> tuple[Place, ...]:
    """West for east."""
    return tuple((-x, y, z) for x, y, z in places)


_WALKING = {f"{_BASE}.limits.cruise_speed": 1.0}
_HOMEWARD = {f"{_BASE}.mission.on_complete": "return"}
_HOME: Place = (0.0, 0.0, 5.0)
_SQUARE = _level(5.0, (0, 5), (5, 5), (5, 0), (0, 0))
"""Clockwise: its inside is to the right."""


_farm = partial(Task, environment="farm", changes=_WALKING)
_tower = partial(Task, environment="tower", changes=_HOMEWARD)


def _square_tasks() -> list[Task]:
    home, square = _HOME, _SQUARE
    along, inwards = legs(home, square), legs(home, square, -90.0)
    above = (0.0, 0.0, 10.0)
    reverse = _level(10.0, (5, 0), (5, 5), (0, 5), (0, 0))
    back, same = legs(above, reverse, 90.0), legs(above, _moved(square, 0, 0, 5), -90.0)
    east = [replace(leg, heading=_EAST) for leg in along]
    as_compass = [replace(leg, heading=90.0 - leg.heading) for leg in along]
    return [
        _farm(
            "N1",
            request="At 5 m, fly a square of 5 m: north, east, south, west.",
            truth=(at(*square),),
            solution=_through(*square),
            miss=_through(*((y, x, z) for x, y, z in square)),
            mistake="east and north exchanged",
            fails=("at",),
        ),
        _farm(
            "N2",
            request="Look north. At 5 m, fly 5 m ahead, turn right, and so round a square.",
            truth=(at(*square), nose(*along)),
            solution=_flown(turned(along)),
            miss=_flown(turned(as_compass)),
            mistake="compass degrees as yaw",
            fails=("nose",),
        ),
        _farm(
            "N3",
            request="Fly a square of 5 m at 5 m, north first, clockwise; always look back.",
            truth=(at(*square), nose(*legs(home, square, 180.0))),
            solution=_flown(turned(legs(home, square, 180.0))),
            miss=_flown(turned(along)),
            mistake="looks ahead",
            fails=("nose",),
        ),
        _farm(
            "N4",
            request="At 5 m look west, then east; then fly a square, north first, looking east.",
            truth=(look(home, _WEST, _EAST), at(*square), nose(*east)),
            solution=_flown([stop(home, _WEST, 2), stop(home, _EAST, 2), *turned(east)]),
            miss=_flown([stop(home, _EAST, 4), *turned(east)]),
            mistake="never looks west",
            fails=("look",),
        ),
        _farm(
            "N5",
            request="Fly a square of 5 m at 5 m, north first, clockwise, looking into it.",
            truth=(at(*square), nose(*inwards)),
            solution=_flown(turned(inwards)),
            miss=_flown(turned(legs(home, square, 90.0))),
            mistake="looks out of it",
            fails=("nose",),
        ),
        _farm(
            "N6",
            request="As before, then 5 m higher the other way round, still looking in.",
            truth=(at(*square, *reverse), nose(*inwards), nose(*back)),
            solution=_flown([*turned(inwards), *turned(back)]),
            miss=_flown([*turned(inwards), *turned(same)]),
            mistake="the same way round",
            fails=("at", "nose"),
        ),
        _tower(
            "N7",
            request="At 5 m, a square of 5 m east of the start, then its mirror image west of it.",
            truth=(at(*square, *_mirrored(square)),),
            solution=_through(*square, *_mirrored(square)),
            miss=_through(*square, *square),
            mistake="east twice",
            fails=("at",),
        ),
    ]


def _eights() -> list[Task]:
    behind = _level(5.0, (-5, 0), (-5, -5), (0, -5), (0, 0))
    ahead = _SQUARE
    first, second = legs(_HOME, behind), legs(_HOME, ahead)
    inwards, outwards = legs(_HOME, ahead, -90.0), legs(_HOME, ahead, 90.0)
    lower = _moved(_level(5.0, (0, 5), (5, 5), (5, 0), (0, 0)), 0, -5, -2)
    higher = _moved(_SQUARE, 0, 5, -2)
    return [
        _tower(
            "N8",
            request="Looking north at 5 m: an eight, behind left, then ahead right; nose ahead.",
            truth=(at(*behind, *ahead), nose(*first, *second)),
            solution=_flown(turned([*first, *second])),
            miss=_flown(turned([*second, *first])),
            mistake="the other square first",
            fails=("at", "nose"),
        ),
        _tower(
            "N9",
            request="The same eight, but look into the second square.",
            truth=(at(*behind, *ahead), nose(*first, *inwards)),
            solution=_flown(turned([*first, *inwards])),
            miss=_flown(turned([*first, *outwards])),
            mistake="looks out of it",
            fails=("nose",),
        ),
        _tower(
            "N10",
            request="At 5 m, a square of 5 m, north first; again 5 m further south and 2 m lower.",
            truth=(at(*_SQUARE, *lower),),
            solution=_through(*_SQUARE, (0, -5, 3), *lower),
            miss=_through(*_SQUARE, (0, 5, 3), *higher),
            mistake="further north",
            fails=("at",),
        ),
    ]


def _places() -> list[Task]:
    globe = {"x": 13.016781, "y": 77.569592, "z": 12.0, "waypoint_type": "global_relative"}
    spot: Place = (10.0, 20.0, 12.0)
    east_of = {"x": 20.0, "y": 10.0, "z": 12.0, "hover_duration": 8.0}
    corners = ring((0, 12), 8, 6, 6, _SOUTH)
    across = ring((0, 12), 8 / math.cos(math.pi / 6), 6, 6, _SOUTH)
    mast = (24.0, 16.0)
    circle = ring(mast, 8, 10, 36, 213.7)
    ring_of_mast = [place[:2] for place in circle]
    looking = [
        stop(place, math.degrees(math.atan2(mast[1] - place[1], mast[0] - place[0])))
        for place in circle
    ]
    column = [(0.0, 10.0, height) for height in (3.0, 6.0, 9.0, 12.0)]
    no_fly = [(10, 2), (20, 2), (20, 14), (10, 14)]
    cabin = _level(4.5, (4.25, 11.5), (16.75, 11.5), (16.75, 23.5), (4.25, 23.5), (4.25, 11.5))
    return [
        _tower(
            "N11",
            request="Fly to 13.016781 N, 77.569592 E, 12 m above home, and wait there for 8 s.",
            truth=(stays(spot, seconds=(7, 9), level=1.0, height=1.0),),
            solution=_flown([{**globe, "hover_duration": 8.0}]),
            miss=_flown([east_of]),
            mistake="east and north exchanged",
            fails=("stays",),
        ),
        _tower(
            "N12",
            request="A regular hexagon round (0, 12), 8 m from its centre to each corner, at 6 m.",
            truth=(hexagon((0, 12), 8, 6),),
            solution=_through(*corners),
            miss=_through(*across),
            mistake="8 m to each side",
            fails=("hexagon",),
        ),
        _tower(
            "N13",
            request="Once round the mast at (24, 16), 8 m from it and 10 m up, looking at it.",
            truth=(encircled(Gap(mast, 7, 9), 10), nose_at(mast, ring_of_mast, within=15)),
            solution=_flown(looking),
            miss=_through(*circle),
            mistake="looks ahead",
            fails=("nose",),
        ),
        _tower(
            "N14",
            request="Go above (0, 10) to 3, 6, 9 and 12 m, and stay 4 s at each height.",
            truth=(stays(*column, seconds=(3, 5)),),
            solution=_flown([stop(place, hover=4.0) for place in column]),
            miss=_flown([stop(place, hover=4.0) for place in column[:3]]),
            mistake="one height short",
            fails=("stays",),
        ),
        Task(
            "N15",
            "vehicle",
            "Fly to (30, 8) at 4 m and come back. Keep out of the no-fly area.",
            truth=(at((30, 8, 4)), outside(no_fly)),
            solution=_through((30, 8, 4)),
            miss=_through((30, -8, 4)),
            mistake="mirror image",
            fails=("at",),
            changes={f"{_BASE}.limits.geofence.no_fly": [no_fly]},
        ),
        Task(
            "N16",
            "rescue",
            "Once round the cabin, 3 m from its walls and 4.5 m up.",
            truth=(encircled(Gap((10.5, 17.5), 2.5, 4.5, "cabin"), 4.5),),
            solution=_through(*cabin, robot="tello"),
            miss=_through(*cabin[:4], *cabin[2::-1], robot="tello"),
            mistake="three sides, and back",
            fails=("round",),
        ),
    ]


def _tours() -> list[Task]:
    places = _level(3.0, (-2, 10), (10, 4), (12, 20), (0, 28), (13, 33))
    one, two, three = (10.0, 4.0, 3.0), (0.0, 28.0, 3.0), (12.0, 20.0, 3.0)
    truth = arrivals((one, 5.0, 30.0), (two, 0.0, 60.0), (three, 0.0, math.inf))
    strips = [0.5, 3.5, 6.5, 9.5]
    wide = [1.0, 5.0, 9.0]
    return [
        Task(
            "N17",
            "disaster",
            "Visit (-2, 10), (10, 4), (12, 20), (0, 28) and (13, 33) at 3 m by a short way.",
            truth=(
                arrivals(*((place, 0.0, math.inf) for place in places)),
                short_way(places, 1.05),
            ),
            solution=_through(places[1], places[2], places[4], places[3], places[0]),
            miss=_through(*places),
            mistake="the order of the request",
            fails=("way",),
        ),
        Task(
            "N18",
            "disaster",
            "At 3 m: 5 s at (10, 4) before 30 s have passed, (0, 28) before 60 s, and (12, 20).",
            truth=(truth,),
            solution=_flown([stop(one, hover=6), stop(two), stop(three)]),
            miss=_flown([stop(three), stop(one, hover=6), stop(two)]),
            mistake="the one without deadline first",
            fails=("arrivals",),
        ),
        Task(
            "N19",
            "farm",
            "Film the crop, (0, 0) to (10, 10), at 4 m in strips 3 m apart.",
            truth=(coverage((0, 0, 10, 10), 1.6),),
            solution=_through(*_strips(strips)),
            miss=_through(*_strips(wide)),
            mistake="strips 4 m apart",
            fails=("coverage",),
            changes=_WALKING,
        ),
        _early_return(places),
    ]


def _strips(easts: Sequence[float]) -> list[Place]:
    """Ends of strips from south to north and back, 4 m up."""
    ends = (0.0, 10.0)
    return [
        (east, north, 4.0)
        for number, east in enumerate(easts)
        for north in (ends if number % 2 == 0 else ends[::-1])
    ]


def _early_return(places: Sequence[Place]) -> Task:
    def at_charge(limit: float) -> Make:
        fell = {"$settings": "Below", "of": {"reading": "battery", "limit": limit}}
        # A trigger's commands land or pause: the queue is emptied, which ends in the return.
        analyses = [
            {
                "id": f"{_BASE}/charge",
                "analysis": "MonitoringAnalytics",
                "settings": {"readings": ["battery"]},
                "reads": [f"{_BASE}/odom"],
                "triggers": [{"target": f"{_BASE}/low", "when": fell}],
            },
            {
                "id": f"{_BASE}/low",
                "analysis": "MonitoringAnalytics",
                "settings": {"readings": ["battery"]},
                "reads": [f"{_BASE}/odom"],
            },
        ]
        return _through(
            *places,
            sensors=[f"{_BASE}/odom"],
            analyses=analyses,
            navigation={"clear_on": f"{_BASE}/low"},
        )

    return Task(
        "N20",
        "disaster",
        "Visit the same places, but come home at 40 % of charge, whatever is left.",
        truth=(returned(0.40, within=3.0),),
        solution=at_charge(0.40),
        miss=at_charge(0.42),
        mistake="comes home at 42 %",
        fails=("return",),
        changes={**_WALKING, f"{_BASE}.settings.battery": 0.45},
    )


def _missions() -> list[Task]:
    drops = _level(1.0, (0, 10), (10, 10), (10, 0))
    above = _moved(drops, 0, 0, 3)
    delivery = [
        one
        for drop, over in zip(drops, above, strict=True)
        for one in (stop(over), stop(drop, hover=11), stop(over))
    ]
    low = [stop(drop, hover=11) for drop in drops]
    around = [(-1.0, -1.0), (11.0, -1.0), (11.0, 11.0), (-1.0, 11.0)]
    frame = _along([*around, around[0]], 3.0)
    filmed = [stop(p, math.degrees(math.atan2(5 - p[1], 5 - p[0]))) for p in frame]
    fence = [(-3.0, 13.5), (14.0, 13.5), (14.0, -2.0)]
    north = [stop((x, 11.0, 3.0), _NORTH) for x in (-3.0, 11.5)]
    east = [stop((11.5, y, 3.0), _EAST) for y in (11.0, -2.0)]
    return [
        _farm(
            "M1",
            request="Deliver to (0, 10), (10, 10), (10, 0): down to 1 m, 10 s, up again.",
            truth=(stays(*drops, seconds=(10, 60)), between(drops, 3.0)),
            solution=_flown(delivery),
            miss=_flown(low),
            mistake="stays low between",
            fails=("between",),
        ),
        _farm(
            "M2",
            request="Film the crop from all round, a metre outside it, looking in.",
            truth=(outline(around, within=0.7), nose_at((5, 5), around, within=15)),
            solution=_flown(filmed),
            miss=_through(*_along([*around, around[0]], 3.0)),
            mistake="looks ahead",
            fails=("nose",),
        ),
        _farm(
            "M3",
            request="Inspect the wooden fence from end to end, 2.5 m from it and 3 m up.",
            truth=(inspected(fence, 2.5, 3.0, within=0.7, degrees=20),),
            solution=_flown([*north, *east]),
            miss=_flown(north),
            mistake="one side of two",
            fails=("inspected",),
        ),
        _application(
            "M4",
            "tower",
            "Find the radio tower and inspect it up to 35 m.",
            "tower_inspection",
            _up_to_20_metres,
            "up to 20 m",
            ("climbed",),
        ),
        _application(
            "M5",
            "rescue",
            "Find who is lost, and stay with them to the road.",
            "search_and_rescue",
            _half_way,
            "lands half way to the road",
            ("followed",),
        ),
    ]


def _up_to_20_metres(analyses: list[Content]) -> None:
    analyses[0]["settings"]["top"] = 20


def _half_way(analyses: list[Content]) -> None:
    analyses[-1]["triggers"][0]["when"]["of"]["place"] = [30, 16]


def _along(corners: Sequence[tuple[float, float]], height: float) -> list[Place]:
    """Places a metre apart along straight lines."""
    places = []
    for (x, y), (to_x, to_y) in itertools.pairwise(corners):
        steps = round(math.dist((x, y), (to_x, to_y)))
        places += [
            (x + (to_x - x) * number / steps, y + (to_y - y) * number / steps, height)
            for number in range(steps)
        ]
    return [*places, (*corners[-1], height)]


def _application(
    name: str,
    environment: str,
    request: str,
    application: str,
    spoil: Callable[[list[Content]], None],
    mistake: str,
    fails: tuple[str, ...],
) -> Task:
    """A task of an application's own document, whose analyses `spoil` changes for the near miss."""

    def solution() -> MissionDocument:
        return compile_application(APPS / f"{application}.py", [])

    def miss() -> MissionDocument:
        content = solution().model_dump(mode="json")
        spoil(content["analyses"])
        return MissionDocument.model_validate(content)

    truth = MISSIONS[application].criteria
    return Task(
        name,
        environment,
        request,
        truth,
        solution,
        miss,
        mistake,
        fails,
        always=(),
        networks=True,
    )


TASKS = {
    task.name: task for task in (*_square_tasks(), *_eights(), *_places(), *_tours(), *_missions())
}
"""By name."""

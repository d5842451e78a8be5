"""Ground stations' plans, `.plan` and `.waypoints`, as navigation is made from them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence

from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.plans.commands import command_name
from aerodaas.extensions.plans.fences import geofence_of
from aerodaas.extensions.plans.navigation import flown_plan, read_plan
from aerodaas.geometry.frames import GeodeticOrigin
from tools.fuzz.scratch import scratch_file

__all__ = ["run", "seeds"]

_HOME = GeodeticOrigin(47.0, 8.0, 488.0)
_FILE = scratch_file(".plan")
command_name(16)  # loads MAVLink's names, which takes longer than any input may


def seeds() -> Iterable[bytes]:
    """Plans of simple items, a survey, a fence and rally points; lines."""
    items = [
        _item(22, [15.0, 0.0, 0.0, None, 47.0, 8.0, 10.0]),
        _item(178, [1, 5.0, -1, 0, 0, 0, 0]),
        _item(16, [2.0, 0.0, 0.0, 90.0, 47.0001, 8.0002, 12.5]),
        _item(82, [0.0, 0.0, 0.0, None, 47.0002, 8.0002, 500.0], frame=0),
        _item(19, [4.0, 0.0, 5.0, 0.0, 47.0001, 8.0001, 9.0]),
        _item(93, [4.0, 0, 0, 0, 0, 0, 0]),
        _item(206, [25.0, 0, 1, 0, 0, 0, 0]),
        _item(20, [0, 0, 0, 0, 0, 0, 0]),
    ]
    yield _plan(items)
    survey = {
        "type": "ComplexItem",
        "complexItemType": "survey",
        "TransectStyleComplexItem": {"Items": items[2:4]},
    }
    yield _plan([items[0], survey, items[-1]])
    corners = [[47.0, 8.0], [47.0, 8.001], [47.001, 8.0005]]
    fence = {
        "version": 2,
        "polygons": [{"inclusion": True, "polygon": corners}],
        "circles": [{"inclusion": False, "circle": {"center": corners[0], "radius": 20}}],
    }
    rally = {"version": 2, "points": [[47.0, 8.0, 30.0]]}
    yield _plan(items, geoFence=fence, rallyPoints=rally)
    yield (
        b"QGC WPL 110\n"
        b"0\t1\t0\t16\t0\t0\t0\t0\t47.0\t8.0\t488.0\t1\n"
        b"1\t0\t3\t22\t0\t0\t0\t0\t47.0\t8.0\t20.0\t1\n"
        b"2\t0\t0\t16\t2\t0\t0\t0\t47.001\t8.0\t520.0\t1\n"
        b"3\t0\t3\t206\t9\t0\t0\t0\t0\t0\t0\t1\n"
        b"4\t0\t2\t20\t0\t0\t0\t0\t0\t0\t0\t1\n"
    )


def run(data: bytes) -> None:
    """Read one plan and its fence; each waypoint lies on the globe, at a height that is finite."""
    _FILE.write_bytes(data)
    try:
        waypoints, _ = flown_plan(_FILE)
        geofence_of(read_plan(_FILE).fence, _HOME)
    except AeroDaaSError:
        return
    for one in waypoints:
        if not all(map(math.isfinite, (one.x, one.y, one.z, one.hover_duration))):
            raise AssertionError(f"a waypoint at {one}")


def _item(command: int, params: list[float | None], frame: int = 3) -> dict[str, object]:
    return {
        "type": "SimpleItem",
        "autoContinue": True,
        "command": command,
        "doJumpId": 1,
        "frame": frame,
        "params": params,
    }


def _plan(items: Sequence[Mapping[str, object]], **parts: object) -> bytes:
    content = {
        "fileType": "Plan",
        "groundStation": "QGroundControl",
        "version": 1,
        "mission": {
            "items": items,
            "plannedHomePosition": [47.0, 8.0, 488.0],
            "version": 2,
        },
    }
    return json.dumps(content | parts).encode()

"""A way home as a plan on the vehicle, for ArduPilot's ground-station failsafe to fly."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import shapely

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink.microservices.plans import (
    DEGREE,
    MissionItem,
    download,
    item_place,
    upload,
)
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.mission.safety.geofence import Geofence

__all__ = ["other_way_home", "upload_way_home", "way_home_items"]

_HEIGHT = 0.011
"""Metres by which a height may differ once it was kept: ArduPilot keeps centimetres."""


def way_home_items(
    robot: RobotConfig, places: Sequence[tuple[float, float, float]], origin: GeodeticOrigin
) -> list[MissionItem]:
    """The plan that leads through `places` to the robot's start, and lands there.

    The vehicle joins it at the leg nearest to it (DO_RETURN_PATH_START).

    Args:
        robot: The robot, with its start and its fence.
        places: East, north and up, local metres.
        origin: Geodetic origin of the local frame.

    Returns:
        The items, whose heights are metres above the start.

    Raises:
        VehicleError: If the fence does not allow the way.
    """
    start = np.array(robot.start, dtype=np.float64)
    _require_allowed(robot, places)
    here = item_place(origin, start[0], start[1])
    frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
    stand = (0.0, 0.0, 0.0, 0.0)
    return [
        # ArduPilot keeps its home as the first item, whatever is sent.
        MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, stand, *here, 0.0, mavlink.MAV_FRAME_GLOBAL),
        MissionItem(mavlink.MAV_CMD_DO_RETURN_PATH_START, stand, 0, 0, 0.0, frame),
        *(
            MissionItem(
                mavlink.MAV_CMD_NAV_WAYPOINT,
                stand,
                *item_place(origin, east, north),
                round(up - float(start[2]), 2),
                frame,
            )
            for east, north, up in places
        ),
        MissionItem(mavlink.MAV_CMD_NAV_LAND, stand, *here, 0.0, frame),
    ]


def upload_way_home(link: MavlinkLink, items: Sequence[MissionItem]) -> None:
    """Upload the plan and read it back.

    Args:
        link: The link to the vehicle.
        items: Items of the plan, in order.

    Raises:
        VehicleError: If the vehicle refuses the plan, or holds another one.
    """
    try:
        upload(link, items)
    except VehicleError as error:
        raise VehicleError(
            f'{error}; "way_home": "return" needs no plan (DO_RETURN_PATH_START does: ArduCopter '
            "4.6 or later)"
        ) from None
    if text := other_way_home(link, items):
        raise VehicleError(text)


def other_way_home(link: MavlinkLink, items: Sequence[MissionItem]) -> str:
    """In what the vehicle's plan differs from `items`; empty if in nothing.

    Args:
        link: The link to the vehicle.
        items: Items of the plan, in order; the first is not compared.

    Raises:
        VehicleError: If the vehicle does not tell its plan.
    """
    held = download(link)
    if len(held) != len(items):
        return f"it holds another way home than ours: {len(held)} items instead of {len(items)}"
    for number, (sent, kept) in enumerate(zip(items, held, strict=True)):
        if number and not _same(sent, kept):
            place = f"{kept.x / DEGREE:.7f}, {kept.y / DEGREE:.7f}, {kept.z:g} m"
            return (
                f"it holds another way home than ours: item {number} is command {kept.command} at "
                f"{place}"
            )
    return ""


def _same(sent: MissionItem, kept: MissionItem) -> bool:
    if sent.command != kept.command:
        return False
    if sent.command == mavlink.MAV_CMD_DO_RETURN_PATH_START:
        return True
    there = abs(sent.x - kept.x) <= 1 and abs(sent.y - kept.y) <= 1
    return there and sent.frame == kept.frame and abs(sent.z - kept.z) <= _HEIGHT


def _require_allowed(robot: RobotConfig, places: Sequence[tuple[float, float, float]]) -> None:
    fence = Geofence(robot.limits.geofence)
    for number, place in enumerate(places):
        if objection := fence.objection(np.array(place)):
            raise VehicleError(f"{robot.id}: settings.way_home.{number}: {objection}")
    way = [(place[0], place[1]) for place in (*places, robot.start)]
    if fence.area is None:
        return
    for number, leg in enumerate(itertools.pairwise(way)):
        if not shapely.covers(fence.area, shapely.LineString(leg)):
            raise VehicleError(
                f"{robot.id}: settings.way_home.{number}: the way from there to the next place "
                "leaves the geofence or crosses a no-fly zone"
            )

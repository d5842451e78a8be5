"""Upload of the robot's geofence to the vehicle, with the parameters that enforce it."""

from __future__ import annotations

from aerodaas.config.model import GeofenceConfig
from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot, FenceAction
from aerodaas.drivers.mavlink.microservices.parameters import Parameters
from aerodaas.drivers.mavlink.microservices.plans import MissionItem, item_place, upload
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["fence_items", "upload_fence"]


def fence_items(fence: GeofenceConfig, origin: GeodeticOrigin) -> list[MissionItem]:
    """Items of the fence protocol for the polygons of `fence`.

    Args:
        fence: Polygons in local metres.
        origin: Geodetic origin of the local frame.
    """
    inside = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    outside = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    outlines = [(inside, fence.polygon)] if fence.polygon else []
    outlines += [(outside, outline) for outline in fence.no_fly]
    return [
        _corner(command, east, north, len(outline), origin)
        for command, outline in outlines
        for east, north in outline
    ]


def _corner(
    command: int, east: float, north: float, corners: int, origin: GeodeticOrigin
) -> MissionItem:
    values = (float(corners), 0.0, 0.0, 0.0)
    place = item_place(origin, east, north)
    return MissionItem(command, values, *place, 0.0, mavlink.MAV_FRAME_GLOBAL)


def upload_fence(
    link: MavlinkLink,
    autopilot: Autopilot,
    fence: GeofenceConfig,
    origin: GeodeticOrigin,
    action: FenceAction,
) -> None:
    """Upload `fence` and have it enforced by `action`; blocks.

    The floor is not uploaded: neither autopilot allows a landing below it.

    Args:
        link: The link to the vehicle.
        autopilot: The autopilot's dialect of commands and parameters.
        fence: Polygons in local metres, and the ceiling.
        origin: Geodetic origin of the local frame.
        action: What the vehicle does at the fence.

    Raises:
        VehicleError: If the vehicle does not take the fence or a parameter.
    """
    items = fence_items(fence, origin)
    upload(link, items, mavlink.MAV_MISSION_TYPE_FENCE)
    parameters = Parameters(link, autopilot)
    for name, value in autopilot.fence(action, fence.ceiling).items():
        parameters.set(name, value)

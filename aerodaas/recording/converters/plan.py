"""Entries of plans and geofences: in the 3D scene, as poses, and on the map."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from foxglove.messages import (
    Color,
    GeoJson,
    LinePrimitive,
    LinePrimitiveLineType,
    Point3,
    Pose,
    PosesInFrame,
    SceneEntity,
    SceneUpdate,
    SpherePrimitive,
    TextPrimitive,
    Vector3,
)

from aerodaas.config.model import GeofenceConfig
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.identifiers import internal
from aerodaas.messages.mission import MissionPlan
from aerodaas.messages.waypoints import Waypoint
from aerodaas.recording.converters.base import Session, foxglove_entry, quaternion, vector
from aerodaas.recording.encoding import Entry, topic
from aerodaas.recording.messages import json_entry
from aerodaas.recording.reference_frames import MAP_FRAME, from_rpy
from aerodaas.recording.report.overlay import OKABE_ITO, rgb

__all__ = ["fence_entries", "plan_entries"]

_BALL = 0.25
"""Diameter in metres of a waypoint in the scene."""


def plan_entries(plan: MissionPlan, robot: str, stream: str, session: Session) -> Iterator[Entry]:
    """Write a plan as JSON, scene, poses and, with a home, GeoJSON.

    Args:
        plan: The plan, ENU metres.
        robot: Id of the robot.
        stream: Stream of the plan.
        session: State of the recording, with the home.
    """
    stamp, waypoints = plan.stamp, plan.waypoints
    yield json_entry(plan, stream, stamp, robot=robot)
    time = session.time(stamp)
    colour = _colour("blue")
    entity = SceneEntity(
        timestamp=time,
        frame_id=MAP_FRAME,
        id=f"{robot}/plan",
        lines=[
            LinePrimitive(
                type=LinePrimitiveLineType.LineStrip,
                thickness=2.0,
                scale_invariant=True,
                points=[Point3(x=at.x, y=at.y, z=at.z) for at in waypoints],
                color=colour,
            )
        ],
        spheres=[
            SpherePrimitive(
                pose=_pose(at), size=Vector3(x=_BALL, y=_BALL, z=_BALL), color=_colour("orange")
            )
            for at in waypoints
        ],
        texts=[
            TextPrimitive(
                pose=_pose(at),
                billboard=True,
                font_size=14.0,
                scale_invariant=True,
                color=colour,
                text=at.id,
            )
            for at in waypoints
        ],
    )
    yield foxglove_entry(topic(stream, "scene"), SceneUpdate(entities=[entity]), stamp)
    poses = PosesInFrame(timestamp=time, frame_id=MAP_FRAME, poses=[_pose(at) for at in waypoints])
    yield foxglove_entry(topic(stream, "path"), poses, stamp)
    if session.home is not None:
        home = session.home
        places = [_place((at.x, at.y, at.z), home) for at in waypoints]
        features = [_feature("LineString", places, f"{robot} plan")] if len(places) > 1 else []
        features += [
            _feature("Point", place, at.id) for place, at in zip(places, waypoints, strict=True)
        ]
        yield foxglove_entry(topic(stream, "map"), _geojson(features), stamp)


def fence_entries(fence: GeofenceConfig, robot: str, session: Session) -> Iterator[Entry]:
    """Write a robot's geofence as JSON, scene and, with a home, GeoJSON.

    Args:
        fence: The geofence, ENU metres.
        robot: Id of the robot.
        session: State of the recording, with the home.
    """
    fence_stream = internal(robot, "fence")
    yield json_entry(fence, fence_stream, 0, robot=robot)
    if not fence.polygon:
        return
    colour = _colour("vermilion")
    entity = SceneEntity(
        timestamp=session.time(0),
        frame_id=MAP_FRAME,
        id=f"{robot}/fence",
        lines=[
            LinePrimitive(
                type=LinePrimitiveLineType.LineLoop,
                thickness=2.0,
                scale_invariant=True,
                points=[Point3(x=x, y=y, z=height) for x, y in fence.polygon],
                color=colour,
            )
            for height in (fence.floor, fence.ceiling)
        ],
    )
    yield foxglove_entry(topic(fence_stream, "scene"), SceneUpdate(entities=[entity]), 0)
    if session.home is not None:
        ring = [_place((x, y, 0.0), session.home) for x, y in fence.polygon]
        feature = _feature("Polygon", [[*ring, ring[0]]], f"{robot} geofence")
        yield foxglove_entry(topic(fence_stream, "map"), _geojson([feature]), 0)


def _colour(name: str) -> Color:
    red, green, blue = rgb(OKABE_ITO[name])
    return Color(r=red, g=green, b=blue, a=1.0)


def _pose(at: Waypoint) -> Pose:
    attitude = quaternion(from_rpy(0.0, 0.0, at.yaw or 0.0))
    return Pose(position=vector(at.position), orientation=attitude)


def _place(point: tuple[float, float, float], home: GeodeticOrigin) -> list[float]:
    latitude, longitude, altitude = home.to_geodetic(np.array(point))
    return [longitude, latitude, altitude]


def _feature(kind: str, coordinates: list[Any], name: str) -> dict[str, Any]:
    return {
        "type": "Feature",
        "properties": {"name": name},
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def _geojson(features: list[dict[str, Any]]) -> GeoJson:
    collection = {"type": "FeatureCollection", "features": features}
    return GeoJson(geojson=json.dumps(collection))

"""Converters of vehicle states, setpoints and the odometry, GPS and battery sensors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from foxglove.messages import (
    FrameTransform,
    LocationFix,
    LocationFixPositionCovarianceType,
    Pose,
)
from foxglove.messages import Odometry as FoxgloveOdometry

from aerodaas.messages.envelope import Message
from aerodaas.messages.mission import SetpointRecord
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import Photo
from aerodaas.messages.schema import json_text
from aerodaas.messages.vehicle import FlightEnd, PositionSetpoint, Setpoint, VehicleState
from aerodaas.recording.converters.base import Session, convert, quaternion, vector, xyz
from aerodaas.recording.encoding import Entry, json_bytes, json_schema, topic
from aerodaas.recording.reference_frames import MAP_FRAME, base_link, body_twist
from aerodaas.recording.rotation import from_rpy

__all__ = ["body_frame"]

ODOMETRY = FoxgloveOdometry.get_schema()
TRANSFORM = FrameTransform.get_schema()
LOCATION = LocationFix.get_schema()
STATE = json_schema(
    "VehicleState",
    stamp="integer",
    robot="string",
    mode="string",
    armed="boolean",
    battery="object",
    odometry="object",
    faults="array",
    extra="object",
    ended={"enum": [*FlightEnd, None]},
)
BATTERY = json_schema(
    "Battery",
    stamp="integer",
    source="string",
    fraction="number",
    voltage="number",
    current="number",
)
PHOTO = json_schema(
    "Photo",
    stamp="integer",
    robot="string",
    number={},
    label="string",
    place={},
    odometry={},
    gimbal={},
    zoom={},
    file="string",
)
SETPOINT = json_schema(
    "Setpoint",
    stamp="integer",
    robot="string",
    asked={},
    sent={},
    clipped_by="array",
    cause={},
)


def body_frame(source: str) -> str:
    """Name of the body frame of the source's robot; the map's for a source without a robot."""
    robot, slash, _ = source.partition("/")
    return base_link(robot) if slash else MAP_FRAME


@convert.register
def vehicle_state(item: VehicleState, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a state as odometry, transform, location and JSON."""
    stream = message.stream
    robot = (message.header.source or stream).partition("/")[0]
    yield from _pose(item.odometry, base_link(robot), stream, item.stamp, session)
    if item.gps is not None:
        yield _location(item.gps, base_link(robot), stream, item.stamp, session)
    data = json_text(item, robot=robot, without_none=True)
    yield Entry(topic(stream, "state"), STATE, data, item.stamp)


@convert.register
def odometry(item: Odometry, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the reading of an odometry sensor."""
    header = message.header
    yield from _pose(item, body_frame(header.source), message.stream, header.stamp, session)


@convert.register
def gps(item: GpsFix, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the reading of a GPS sensor."""
    header = message.header
    yield _location(item, body_frame(header.source), message.stream, header.stamp, session)


@convert.register
def battery(item: Battery, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the reading of a battery sensor."""
    del session
    header = message.header
    data = json_text(item, stamp=header.stamp, source=header.source)
    yield Entry(topic(message.stream, "battery"), BATTERY, data)


@convert.register
def photo(item: Photo, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write what is known of a picture that the vehicle's own camera took."""
    del session
    robot = (message.header.source or message.stream).partition("/")[0]
    data = json_text(item, robot=robot)
    yield Entry(topic(message.stream, "photos"), PHOTO, data, item.stamp)


@convert.register
def setpoint(item: SetpointRecord, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the requested and the sent setpoint, and the limits that changed it."""
    del session
    value = {
        "stamp": item.stamp,
        "robot": (message.header.source or message.stream).partition("/")[0],
        "asked": _setpoint_json(item.asked),
        "sent": _setpoint_json(item.sent),
        "clipped_by": item.clipped_by,
        "cause": item.cause._asdict() if item.cause else None,
    }
    yield Entry(topic(message.stream, "setpoint"), SETPOINT, json_bytes(value), item.stamp)


def _pose(item: Odometry, frame: str, stream: str, stamp: int, session: Session) -> Iterator[Entry]:
    time = session.time(stamp)
    position = vector(item.position)
    attitude = quaternion(from_rpy(item.roll, item.pitch, item.yaw))
    # Foxglove, like ROS, expects velocities in the frame of the body, which leans.
    velocity, rates = body_twist(item)
    pose = FoxgloveOdometry(
        timestamp=time,
        frame_id=MAP_FRAME,
        body_frame_id=frame,
        pose=Pose(position=position, orientation=attitude),
        linear_velocity=vector(velocity),
        angular_velocity=vector(rates),
    )
    yield Entry(topic(stream, "odometry"), ODOMETRY, pose.encode(), stamp)
    transform = FrameTransform(
        timestamp=time,
        parent_frame_id=MAP_FRAME,
        child_frame_id=frame,
        translation=position,
        rotation=attitude,
    )
    yield Entry(topic(stream, "transform"), TRANSFORM, transform.encode(), stamp)


def _location(fix: GpsFix, frame: str, stream: str, stamp: int, session: Session) -> Entry:
    horizontal, vertical = fix.horizontal_sigma**2, fix.vertical_sigma**2
    kinds = LocationFixPositionCovarianceType
    location = LocationFix(
        timestamp=session.time(stamp),
        frame_id=frame,
        latitude=fix.latitude,
        longitude=fix.longitude,
        altitude=fix.altitude,
        position_covariance=[horizontal, 0, 0, 0, horizontal, 0, 0, 0, vertical],
        position_covariance_type=kinds.DiagonalKnown if horizontal else kinds.Unknown,
    )
    return Entry(topic(stream, "location"), LOCATION, location.encode(), stamp)


def _setpoint_json(setpoint: Setpoint | None) -> dict[str, Any] | None:
    if setpoint is None:
        return None
    if isinstance(setpoint, PositionSetpoint):
        return {
            "kind": "position",
            "position": xyz(setpoint.position),
            "yaw": setpoint.yaw,
            "speed": setpoint.speed,
            "passing_speed": setpoint.passing_speed,
            "line_from": None if setpoint.line_from is None else xyz(setpoint.line_from),
        }
    return {
        "kind": "velocity",
        "velocity": xyz(setpoint.velocity),
        "yaw_rate": setpoint.yaw_rate,
        "evasive": setpoint.evasive,
    }

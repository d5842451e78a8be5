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
from aerodaas.messages.odometry import GpsFix, Odometry
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.converters.base import (
    Session,
    convert,
    foxglove_entry,
    quaternion,
    robot_of,
    vector,
)
from aerodaas.recording.encoding import Entry, topic
from aerodaas.recording.messages import json_entry
from aerodaas.recording.reference_frames import MAP_FRAME, base_link, body_twist, from_rpy

__all__ = ["body_frame"]


def body_frame(source: str) -> str:
    """Name of the body frame of the source's robot; the map's for a source without a robot."""
    robot, slash, _ = source.partition("/")
    return base_link(robot) if slash else MAP_FRAME


@convert.register
def _vehicle_state(item: VehicleState, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write a state as odometry, transform, location and JSON."""
    stream, robot = message.stream, robot_of(message)
    yield from _pose(item.odometry, base_link(robot), stream, item.stamp, session)
    if item.gps is not None:
        yield _location(item.gps, base_link(robot), stream, item.stamp, session)
    yield json_entry(item, stream, item.stamp, robot=robot)


@convert.register
def _odometry(item: Odometry, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the reading of an odometry sensor."""
    header = message.header
    yield from _pose(item, body_frame(header.source), message.stream, header.stamp, session)


@convert.register
def _gps(item: GpsFix, message: Message[Any], session: Session) -> Iterator[Entry]:
    """Write the reading of a GPS sensor."""
    header = message.header
    yield _location(item, body_frame(header.source), message.stream, header.stamp, session)


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
    yield foxglove_entry(topic(stream, "odometry"), pose, stamp)
    transform = FrameTransform(
        timestamp=time,
        parent_frame_id=MAP_FRAME,
        child_frame_id=frame,
        translation=position,
        rotation=attitude,
    )
    yield foxglove_entry(topic(stream, "transform"), transform, stamp)


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
    return foxglove_entry(topic(stream, "location"), location, stamp)

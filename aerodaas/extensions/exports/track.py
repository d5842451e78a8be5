"""Export of the flight track as GPX 1.1 and KML 2.2."""

from __future__ import annotations

import math
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree as ET

from aerodaas.clock import NANOSECONDS
from aerodaas.errors import RecordingError
from aerodaas.geometry.frames import GeodeticOrigin, is_finite
from aerodaas.messages.vehicle import VehicleState
from aerodaas.recording.new_file import new_file
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_environment import recorded_home

__all__ = ["write_gpx", "write_kml"]

_GPX = "http://www.topografix.com/GPX/1/1"
_KML = "http://www.opengis.net/kml/2.2"
_INTERVAL = NANOSECONDS // 2
"""Nanoseconds between points: half a second, finer than a receiver's accuracy."""


class _Place(NamedTuple):
    """A point of the track, or a named waypoint; degrees and metres."""

    latitude: float
    longitude: float
    altitude: float
    time: str = ""
    name: str = ""


class _Track(NamedTuple):
    """Track points and waypoints of one robot."""

    points: list[_Place]
    waypoints: dict[str, _Place]


def write_gpx(recording: Recording, folder: Path) -> Path:
    """Write tracks and waypoints as GPX.

    Args:
        recording: An open recording.
        folder: Folder of the new file, created if necessary.

    Returns:
        The file.

    Raises:
        RecordingError: If the recording has no geodetic position, or the file exists or cannot
            be written.
    """
    root = ET.Element("gpx", {"xmlns": _GPX, "version": "1.1", "creator": "AeroDaaS"})
    tracks = _tracks(recording)
    # The schema requires all waypoints before the first track.
    for track in tracks.values():
        for place in track.waypoints.values():
            _gpx_point(root, "wpt", place)
    for robot, track in tracks.items():
        element = ET.SubElement(root, "trk")
        ET.SubElement(element, "name").text = robot
        segment = ET.SubElement(element, "trkseg")
        for place in track.points:
            _gpx_point(segment, "trkpt", place)
    return _write(root, folder / f"{recording.path.stem}.gpx")


def write_kml(recording: Recording, folder: Path) -> Path:
    """Write tracks and waypoints as KML.

    Args:
        recording: An open recording.
        folder: Folder of the new file, created if necessary.

    Returns:
        The file.

    Raises:
        RecordingError: If the recording has no geodetic position, or the file exists or cannot
            be written.
    """
    root = ET.Element("kml", {"xmlns": _KML})
    document = ET.SubElement(root, "Document")
    ET.SubElement(document, "name").text = recording.provenance.get("name") or recording.path.stem
    for robot, track in _tracks(recording).items():
        path = _placemark(document, robot)
        line = ET.SubElement(path, "LineString")
        ET.SubElement(line, "altitudeMode").text = "absolute"
        ET.SubElement(line, "coordinates").text = " ".join(map(_kml_point, track.points))
        for place in track.waypoints.values():
            point = ET.SubElement(_placemark(document, place.name), "Point")
            ET.SubElement(point, "altitudeMode").text = "absolute"
            ET.SubElement(point, "coordinates").text = _kml_point(place)
    return _write(root, folder / f"{recording.path.stem}.kml")


def _tracks(recording: Recording) -> dict[str, _Track]:
    """Tracks by robot: from odometry if the environment has a home, else from GPS."""
    home = _home(recording)
    tracks: dict[str, _Track] = {}
    newest: dict[str, int] = {}
    for record in recording.records(schemas=["aerodaas.VehicleState", "aerodaas.Plan"]):
        robot = record.labels.robot
        track = tracks.setdefault(robot, _Track([], {}))
        if record.schema == "aerodaas.Plan":
            if home is not None:
                for at in record.value.waypoints:
                    track.waypoints[at.id] = _Place(*home.to_geodetic(at.position), "", at.id)
            continue
        place = _position(record.value, home)
        early = record.captured < newest.get(robot, -_INTERVAL) + _INTERVAL
        if place is None or early:
            continue
        newest[robot] = record.captured
        moment = datetime.fromtimestamp(
            (recording.epoch_ns + record.captured) / NANOSECONDS, timezone.utc
        )
        time = moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        track.points.append(_Place(*place, time))
    if not any(track.points for track in tracks.values()):
        raise RecordingError(
            f"{recording.path} does not say where on the globe it flew: give the environment a "
            '"home", or fly with GPS'
        )
    return tracks


def _position(
    state: VehicleState, home: GeodeticOrigin | None
) -> tuple[float, float, float] | None:
    if home is not None:
        at = state.odometry.position
        return home.to_geodetic(at) if is_finite(at) else None
    gps = state.gps
    if gps is None or not all(map(math.isfinite, (gps.latitude, gps.longitude, gps.altitude))):
        return None
    return gps.latitude, gps.longitude, gps.altitude


def _home(recording: Recording) -> GeodeticOrigin | None:
    home = recorded_home(recording)
    return home.origin if home else None


def _gpx_point(parent: ET.Element, kind: str, place: _Place) -> None:
    where = {"lat": f"{place.latitude:.8f}", "lon": f"{place.longitude:.8f}"}
    point = ET.SubElement(parent, kind, where)
    ET.SubElement(point, "ele").text = f"{place.altitude:.2f}"
    for tag, text in (("time", place.time), ("name", place.name)):
        if text:
            ET.SubElement(point, tag).text = text


def _kml_point(place: _Place) -> str:
    return f"{place.longitude:.8f},{place.latitude:.8f},{place.altitude:.2f}"


def _placemark(parent: ET.Element, name: str) -> ET.Element:
    placemark = ET.SubElement(parent, "Placemark")
    ET.SubElement(placemark, "name").text = name
    return placemark


def _write(root: ET.Element, path: Path) -> Path:
    new_file(path)
    ET.indent(root)
    try:
        ET.ElementTree(root).write(path, encoding="utf-8", xml_declaration=True)
    except OSError as error:
        raise RecordingError(f"cannot write {path}: {error.strerror}") from None
    return path

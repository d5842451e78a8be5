"""Pictures beside a recording: geotagged JPEG files, and a table of them for photogrammetry.

A simulated camera's pictures are rendered here, from the moment that each `Photo` tells; a real
one keeps its own, and the table has their names.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import cv2
from PIL import Image
from PIL.ExifTags import GPS, IFD, Base

from aerodaas.cameras.simulated import SimulatedCamera
from aerodaas.clock import seconds
from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import AeroDaaSError, RecordingError
from aerodaas.geometry.frames import wrap_angle, yaw_enu_to_ned
from aerodaas.messages.envelope import Message
from aerodaas.messages.payload import Photo, PhotoPlace
from aerodaas.recording.sidecar import SidecarWriter

__all__ = ["COLUMNS", "PhotoAlbum"]

COLUMNS = (
    *("file", "latitude", "longitude", "altitude", "altitude_above"),
    *("yaw", "pitch", "roll", "stamp", "label", "east", "north", "up"),
)
"""Of `photos.csv`: WGS84 degrees and metres above `altitude_above` (ellipsoid or sea); the camera's
yaw as a heading (degrees clockwise from north), its pitch (degrees, -90 straight down) and roll;
seconds of mission time; what it was taken for; metres from the environment's home. A figure that is
not known is empty."""
_QUALITY = 95
"""JPEG quality: photogrammetry matches fine texture, which the recording's own quality blurs."""
_MINUTES, _SECONDS, _PARTS = 60, 3600, 10_000
_ABOVE, _BELOW = b"\x00", b"\x01"
"""GPSAltitudeRef, the sign: EXIF 2 means the sea by it, EXIF 3 the ellipsoid; the table tells."""


class PhotoAlbum(SidecarWriter):
    """Keeper of one recording's pictures, for one thread, which renders.

    Nothing is made before the first picture.
    """

    kind = "photo"

    def __init__(self, recording: Path, environment: EnvironmentConfig) -> None:
        """Keep pictures in the folder `NAME-photos` beside the recording `NAME.mcap`."""
        super().__init__(recording, environment)
        self._folder = recording.with_name(f"{recording.stem}-photos")
        self._environment = environment
        self._cameras: dict[str, SimulatedCamera] = {}
        self._count = 0

    def write(self, message: Message[Any]) -> None:
        """Keep a picture; raises RecordingError if it cannot be kept."""
        if isinstance(message.item, Photo):
            self._add(message.stream.partition("/")[0], message.item)

    def _add(self, robot: str, photo: Photo) -> None:
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._count += 1
            name = photo.file
            if photo.truth is not None:
                name = f"{robot}-{self._count:04d}.jpg"
                self._render(robot, photo, self._folder / name)
            self._enter(name, photo)
        except (OSError, AeroDaaSError) as error:
            raise RecordingError(f"{robot}: a picture is not kept: {error}") from None

    def close(self) -> None:
        """Free the renderers."""
        for camera in self._cameras.values():
            camera.close()
        self._cameras.clear()

    def _enter(self, name: str, photo: Photo) -> None:
        path = self._folder / "photos.csv"
        new = not path.exists()
        # One row at a time, so that a flight that is cut off leaves what it has.
        with path.open("a", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            if new:
                writer.writerow(COLUMNS)
            writer.writerow(_row(name, photo))

    def _render(self, robot: str, photo: Photo, path: Path) -> None:
        camera = self._camera(robot)
        camera.follow_gimbal(photo.gimbal)
        camera.follow_zoom(photo.zoom)
        picture = camera.capture(photo.stamp, photo.truth)
        assert picture is not None  # noqa: S101 - the pose is known
        image = Image.fromarray(cv2.cvtColor(picture.image, cv2.COLOR_BGR2RGB))
        image.save(path, quality=_QUALITY, exif=_exif(photo))

    def _camera(self, robot: str) -> SimulatedCamera:
        if robot not in self._cameras:
            sensor = next(
                sensor
                for one in self._environment.robots
                if one.id == robot
                for sensor in one.sensors
                if sensor.type == "camera"
                and self._environment.camera_driver(sensor) == "simulated"
            )
            camera = SimulatedCamera(sensor, self._environment)
            camera.open()
            self._cameras[robot] = camera
        return self._cameras[robot]


def _row(name: str, photo: Photo) -> list[object]:
    place, odometry = photo.place, photo.odometry
    row: list[object] = [name]
    row += (
        ["", "", "", ""]
        if place is None
        else [
            f"{place.latitude:.8f}",
            f"{place.longitude:.8f}",
            *(("", "") if place.altitude is None else (f"{place.altitude:.3f}", place.datum)),
        ]
    )
    heading, pitch, roll = _camera_attitude(photo)
    row += [_degrees(heading), _degrees(pitch), _degrees(roll)]
    row += [f"{seconds(photo.stamp):.3f}", photo.label]
    row += ["", "", ""] if odometry is None else [f"{axis:.3f}" for axis in odometry.position]
    return row


def _camera_attitude(photo: Photo) -> tuple[float | None, float | None, float | None]:
    """Heading, pitch and roll of the camera, radians, where they are known."""
    if photo.odometry is None:
        return None, None, None
    if photo.gimbal is None:
        return yaw_enu_to_ned(photo.odometry.yaw), None, None
    yaw = wrap_angle(photo.odometry.yaw + photo.gimbal.yaw)
    return yaw_enu_to_ned(yaw), photo.gimbal.pitch, photo.gimbal.roll


def _degrees(angle: float | None) -> str:
    return "" if angle is None else f"{math.degrees(angle):.2f}"


def _exif(photo: Photo) -> Image.Exif:
    """EXIF with the place, where it is known."""
    exif = Image.Exif()
    exif[Base.Software] = "AeroDaaS"
    exif[Base.ImageDescription] = photo.label.encode("ascii", "replace").decode()
    if photo.place is not None:
        tags = exif.get_ifd(IFD.GPSInfo)
        tags.update(_gps_tags(photo.place))
        heading, _, _ = _camera_attitude(photo)
        if heading is not None:
            tags[GPS.GPSImgDirectionRef] = "T"
            tags[GPS.GPSImgDirection] = math.degrees(heading) % 360.0
    return exif


def _gps_tags(place: PhotoPlace) -> dict[int, object]:
    altitude = place.altitude
    height: dict[int, object] = {}
    if altitude is not None:
        height = {
            GPS.GPSAltitudeRef: _BELOW if altitude < 0.0 else _ABOVE,
            GPS.GPSAltitude: abs(altitude),
        }
    return {
        GPS.GPSVersionID: b"\x02\x03\x00\x00",
        GPS.GPSLatitudeRef: "N" if place.latitude >= 0.0 else "S",
        GPS.GPSLatitude: _sexagesimal(place.latitude),
        GPS.GPSLongitudeRef: "E" if place.longitude >= 0.0 else "W",
        GPS.GPSLongitude: _sexagesimal(place.longitude),
        **height,
        GPS.GPSMapDatum: "WGS-84",
    }


def _sexagesimal(angle: float) -> tuple[float, float, float]:
    """Degrees, minutes and seconds to a ten-thousandth, which is 3 mm."""
    total = round(abs(angle) * _SECONDS * _PARTS)
    degrees, rest = divmod(total, _SECONDS * _PARTS)
    minutes, parts = divmod(rest, _MINUTES * _PARTS)
    return float(degrees), float(minutes), parts / _PARTS

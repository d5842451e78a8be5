"""Pictures beside a recording: the file's EXIF and the table's row say where it was taken."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.ExifTags import GPS, IFD

from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import RecordingError
from aerodaas.extensions.payload.photo_album import COLUMNS, PhotoAlbum
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.payload import GimbalAttitude, Photo, PhotoPlace
from aerodaas.runtime.stream_names import photo_stream

HERE = Odometry(np.array([10.0, 4.0, 12.0]), np.zeros(3), math.radians(30), 0.1, -0.1)
ENVIRONMENT = EnvironmentConfig.model_validate(
    {
        "robots": [
            {
                "id": "drone",
                "sensors": [
                    {"id": "odom", "type": "odometry"},
                    {"id": "cam", "settings": {"width": 64, "height": 48, "gimbal": {}}},
                ],
            }
        ],
        "simulation": {"world": "empty"},
    }
)


def photo(place: PhotoPlace | None, pitch: float = -0.5, **words: object) -> Photo:
    """A simulated picture."""
    look = GimbalAttitude(0, pitch, math.radians(15))
    fields = {"odometry": HERE, "gimbal": look, "truth": HERE, **words}
    return Photo(1, 1_500_000_000, "wp1", place, **fields)  # type: ignore[arg-type]


def add(album: PhotoAlbum, taken: Photo) -> None:
    """Have the album keep a picture of the drone's."""
    header = Header(1, taken.stamp, "drone")
    album.write(Message(photo_stream("drone"), 1, taken.stamp, header, 0, (), taken))


def rows(folder: Path) -> list[dict[str, str]]:
    """The table."""
    with (folder / "photos.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.parametrize("south", [1.0, -1.0])
def test_a_simulated_picture_has_its_place_in_it(tmp_path: Path, south: float) -> None:
    """To 3 mm, on either side of the equator and of zero."""
    album = PhotoAlbum(tmp_path / "flight.mcap", ENVIRONMENT)
    place = PhotoPlace(south * 47.39778181, south * 8.54572459, south * 498.5)
    add(album, photo(place))
    album.close()
    with Image.open(tmp_path / "flight-photos" / "drone-0001.jpg") as image:
        assert image.size == (64, 48)
        tags = image.getexif().get_ifd(IFD.GPSInfo)
    for name, reference, signs, angle in (
        (GPS.GPSLatitude, GPS.GPSLatitudeRef, "NS", place.latitude),
        (GPS.GPSLongitude, GPS.GPSLongitudeRef, "EW", place.longitude),
    ):
        degrees, minutes, seconds = map(float, tags[name])
        assert tags[reference] == signs[south < 0]
        assert degrees + minutes / 60 + seconds / 3600 == pytest.approx(abs(angle), abs=3e-8)
    assert float(tags[GPS.GPSAltitude]) == pytest.approx(498.5)
    assert tags[GPS.GPSAltitudeRef] == (b"\x00" if south > 0 else b"\x01")
    assert float(tags[GPS.GPSImgDirection]) == pytest.approx(45.0)


def test_a_picture_of_unknown_altitude_has_its_place_alone(tmp_path: Path) -> None:
    """Neither the file nor the table says the level of the sea."""
    album = PhotoAlbum(tmp_path / "flight.mcap", ENVIRONMENT)
    add(album, photo(PhotoPlace(47.5, 8.5, None, "sea")))
    album.close()
    with Image.open(tmp_path / "flight-photos" / "drone-0001.jpg") as image:
        tags = image.getexif().get_ifd(IFD.GPSInfo)
    assert GPS.GPSLatitude in tags
    assert GPS.GPSAltitude not in tags
    assert GPS.GPSAltitudeRef not in tags
    (row,) = rows(tmp_path / "flight-photos")
    assert row["latitude"] == "47.50000000"
    assert (row["altitude"], row["altitude_above"]) == ("", "")


def test_the_table_has_place_and_attitude(tmp_path: Path) -> None:
    """A row for each picture, with units as documented."""
    album = PhotoAlbum(tmp_path / "flight.mcap", ENVIRONMENT)
    add(album, photo(PhotoPlace(47.5, 8.5, 500.0, "sea"), -math.pi / 2))
    add(album, photo(None))
    album.close()
    first, second = rows(tmp_path / "flight-photos")
    assert tuple(first) == COLUMNS
    assert first == {
        "file": "drone-0001.jpg",
        "latitude": "47.50000000",
        "longitude": "8.50000000",
        "altitude": "500.000",
        "altitude_above": "sea",
        "yaw": "45.00",
        "pitch": "-90.00",
        "roll": "0.00",
        "stamp": "1.500",
        "label": "wp1",
        "east": "10.000",
        "north": "4.000",
        "up": "12.000",
    }
    assert second["file"] == "drone-0002.jpg"
    assert second["latitude"] == second["altitude_above"] == ""


def test_a_real_cameras_picture_stays_on_its_card(tmp_path: Path) -> None:
    """The table has its name there."""
    album = PhotoAlbum(tmp_path / "flight.mcap", ENVIRONMENT)
    add(album, photo(None, truth=None, gimbal=None, file="DCIM/0007.JPG"))
    (row,) = rows(tmp_path / "flight-photos")
    assert row["file"] == "DCIM/0007.JPG"
    assert row["pitch"] == ""
    assert [path.name for path in (tmp_path / "flight-photos").iterdir()] == ["photos.csv"]


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    """As an error that the recorder can tell."""
    (tmp_path / "flight-photos").write_text("a file")
    with pytest.raises(RecordingError, match="a picture is not kept"):
        add(PhotoAlbum(tmp_path / "flight.mcap", ENVIRONMENT), photo(None))

"""A folder of pictures behaves like a camera, whatever lies in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from aerodaas.cameras.base import Camera
from aerodaas.cameras.folder import FolderCamera
from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.errors import ConfigError, SourceError

ENVIRONMENT = EnvironmentConfig(robots=[RobotConfig(id="drone")])
PERIOD = NANOSECONDS // 10


def camera(**settings: Any) -> FolderCamera:  # noqa: ANN401 - a sensor's settings are free
    """A camera of 10 Hz that was not opened yet."""
    sensor = SensorConfig(id="cam", driver="folder", rate=10, settings=settings)
    return FolderCamera(sensor, ENVIRONMENT)


def write(path: Path, grey: int = 0, size: tuple[int, int] = (36, 64)) -> None:
    """Write a picture of one grey level."""
    assert cv2.imwrite(str(path), np.full((*size, 3), grey, np.uint8))


def play(source: FolderCamera, turns: int) -> list[str]:
    """Labels of the pictures given in `turns` periods."""
    pictures = [source.capture(5 * NANOSECONDS + turn * PERIOD, None) for turn in range(turns)]
    return [picture.label for picture in pictures if picture is not None]


def test_pictures_are_played_in_natural_order_at_the_sensors_rate(tmp_path: Path) -> None:
    """frame_2 comes before frame_10; between two turns there is nothing new."""
    for number in (10, 2, 1):
        write(tmp_path / f"frame_{number}.png", number)
    (tmp_path / "notes.txt").write_text("not a picture")
    source = camera(path=str(tmp_path), horizontal_fov=90)
    assert isinstance(source, Camera)
    source.open()
    first = source.capture(NANOSECONDS, None)
    assert first is not None
    assert (first.label, first.stamp, int(first.image[0, 0, 0])) == ("frame_1.png", NANOSECONDS, 1)
    assert source.capture(NANOSECONDS + PERIOD // 3, None) is None
    assert source.model is not None
    assert source.model.width == 64
    assert source.model.fx == pytest.approx(32)
    second = source.capture(NANOSECONDS + PERIOD, None)
    third = source.capture(NANOSECONDS + 2 * PERIOD, None)
    assert second is not None
    assert third is not None
    assert [second.label, third.label] == ["frame_2.png", "frame_10.png"]
    assert source.finished
    assert source.capture(NANOSECONDS + 3 * PERIOD, None) is None
    source.close()


def test_a_loop_never_finishes(tmp_path: Path) -> None:
    """After the last picture comes the first."""
    for number in range(2):
        write(tmp_path / f"{number}.png")
    source = camera(path=str(tmp_path), loop=True)
    source.open()
    assert play(source, 5) == ["0.png", "1.png", "0.png", "1.png", "0.png"]
    assert not source.finished


def test_broken_pictures_are_skipped_counted_and_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An empty file, a foreign one, and a JPEG cut short, which OpenCV would fill with grey."""
    write(tmp_path / "1.jpg", 80, (240, 320))
    (tmp_path / "2.jpg").write_bytes(b"")
    (tmp_path / "3.png").write_bytes(b"no picture at all")
    whole = (tmp_path / "1.jpg").read_bytes()
    (tmp_path / "4.jpg").write_bytes(whole[: len(whole) * 2 // 3])
    write(tmp_path / "5.jpg", 80)
    source = camera(path=str(tmp_path), loop=True)
    source.open()
    assert play(source, 10) == ["1.jpg", "5.jpg"] * 2
    assert source.skipped == 3
    assert [name in caplog.text for name in ("2.jpg", "3.png", "4.jpg")] == [True] * 3


def test_every_kind_of_pixel_becomes_8_bit_bgr(tmp_path: Path) -> None:
    """Grey, 16-bit, transparent, and sizes that change."""
    bright = 200
    pictures: dict[str, NDArray[Any]] = {
        "1.png": np.full((20, 30), bright, np.uint8),
        "2.png": np.full((40, 50), bright << 8, np.uint16),
        "3.png": np.full((10, 60, 4), bright, np.uint8),
        "4.png": np.full((25, 35, 3), bright << 8, np.uint16),
        "5.webp": np.full((16, 16, 3), bright, np.uint8),
        "6.bmp": np.full((18, 16), bright, np.uint8),
    }
    for name, image in pictures.items():
        assert cv2.imwrite(str(tmp_path / name), image)
    source = camera(path=str(tmp_path))
    source.open()
    for turn, image in enumerate(pictures.values()):
        picture = source.capture(turn * PERIOD, None)
        assert picture is not None
        assert picture.image.dtype == np.uint8
        assert picture.image.shape == (*image.shape[:2], 3)
        assert abs(int(picture.image[5, 5, 1]) - bright) <= 2
        assert source.model is not None
        assert (source.model.height, source.model.width) == image.shape[:2]


def test_a_folder_without_readable_pictures_is_refused(tmp_path: Path) -> None:
    """Missing, empty, or all broken: the message names the folder and the remedy."""
    with pytest.raises(SourceError, match=r"gone: No such file.*existing folder"):
        camera(path=str(tmp_path / "gone")).open()
    with pytest.raises(SourceError, match="holds no pictures; put"):
        camera(path=str(tmp_path)).open()
    for number in range(3):
        (tmp_path / f"{number}.jpg").write_bytes(b"broken")
    with pytest.raises(SourceError, match="none of the 3 pictures"):
        camera(path=str(tmp_path)).open()


def test_settings_are_checked() -> None:
    """A missing path, a lens that cannot be, an unknown setting."""
    with pytest.raises(ConfigError, match=r"sensor cam: settings: give the folder of pictures"):
        camera()
    with pytest.raises(ConfigError, match=r"sensor cam: settings: horizontal_fov"):
        camera(path="x", horizontal_fov=200)
    with pytest.raises(ConfigError, match=r"sensor cam: settings: pth"):
        camera(path="x", pth="y")

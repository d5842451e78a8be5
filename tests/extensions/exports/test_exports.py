"""Videos and tracks are right by other programs' own reading, whatever the recording holds."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as ET

import av
import cv2
import numpy as np
import pytest
from synthetic_flight import HOME, PLAN, SyntheticFlight, record
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.config.model import RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.extensions.exports.track import write_gpx, write_kml
from aerodaas.extensions.exports.video import write_videos
from aerodaas.recording.reader import Recording

GPX = "{http://www.topografix.com/GPX/1/1}"
KML = "{http://www.opengis.net/kml/2.2}"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight with a few frames."""
    path = tmp_path_factory.mktemp("export") / "flight.mcap"
    record(path, SyntheticFlight(frames=0.5, rate=10))
    return path


def test_video_plays_at_the_pictures_times(recorded: Path, tmp_path: Path) -> None:
    """Every frame is there, as H.264, as long as the flight, with the boxes drawn in."""
    with Recording.open(recorded) as recording:
        pictures = recording.topics["/tello/camera/image"].count
        (path,) = write_videos(recording, tmp_path)
        (plain,) = write_videos(recording, tmp_path / "plain", overlays=False)
    assert path.name == "tello-camera.mp4"
    drawn, bare = (cv2.VideoCapture(str(each)).read()[1] for each in (path, plain))
    difference = np.abs(np.asarray(drawn, float) - np.asarray(bare, float)).mean(axis=2)
    assert difference[45:135, 98:103].mean() > 10 * difference[20:40, 200:].mean()
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 320, 180)
        assert stream.frames == pictures
        assert stream.duration is not None
        assert stream.time_base is not None
        assert float(stream.duration * stream.time_base) == pytest.approx(106.0, abs=2.5)
        assert sum(1 for _ in film.decode(stream)) == pictures


def test_tracks_lie_where_the_drone_flew(recorded: Path, tmp_path: Path) -> None:
    """GPX and KML agree with home, waypoints and the height flown."""
    with Recording.open(recorded) as recording:
        gpx = ET.parse(write_gpx(recording, tmp_path)).getroot()  # noqa: S314
        kml = ET.parse(write_kml(recording, tmp_path)).getroot()  # noqa: S314
    points = gpx.findall(f"{GPX}trk/{GPX}trkseg/{GPX}trkpt")
    assert len(points) == pytest.approx(212, abs=3)
    places = [(at.get("lat"), at.get("lon"), at.findtext(f"{GPX}ele")) for at in points]
    local = np.array([HOME.to_local(*(float(axis or "nan") for axis in at)) for at in places])
    assert np.ptp(local[:, :2], axis=0) == pytest.approx([10, 10], abs=0.3)
    assert local[:, 2].max() == pytest.approx(1.5, abs=0.2)
    assert [at.findtext(f"{GPX}name") for at in gpx.findall(f"{GPX}wpt")] == [w.id for w in PLAN]
    names = [mark.findtext(f"{KML}name") for mark in kml.iter(f"{KML}Placemark")]
    assert names == ["tello", *(w.id for w in PLAN)]
    line = kml.find(f".//{KML}LineString/{KML}coordinates")
    assert line is not None
    assert len((line.text or "").split()) == len(points)


def test_recording_without_pictures(tmp_path: Path) -> None:
    """Asking for a video of nothing is answered, and leaves nothing behind."""
    path = tmp_path / "flight.mcap"
    record(path, SyntheticFlight(frames=1, rate=2), config=RecordingConfig(images="none"))
    with Recording.open(path) as recording, pytest.raises(RecordingError, match="no pictures"):
        write_videos(recording, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_video_of_a_recorded_video_has_every_frame(tmp_path: Path) -> None:
    """H.264 is exported as pictures are."""
    path = tmp_path / "flight.mcap"
    config = RecordingConfig(images="h264")
    record(path, SyntheticFlight(frames=1, rate=10), config=config)
    with Recording.open(path) as recording:
        expected = recording.topics["/tello/camera/image"].count
        (video,) = write_videos(recording, tmp_path / "out")
    with av.open(str(video)) as container:
        assert sum(1 for _ in container.decode(video=0)) == expected


def test_the_commands_write_into_a_folder(recorded: Path, tmp_path: Path) -> None:
    """Each prints the files that it has written."""
    for name, suffix in (("gpx", ".gpx"), ("kml", ".kml"), ("mp4", ".mp4")):
        done = CliRunner().invoke(app, ["export", name, str(recorded), "--out", str(tmp_path)])
        assert done.exit_code == 0, done.output
        assert Path(done.output.strip()).suffix == suffix
        assert Path(done.output.strip()).stat().st_size > 1000

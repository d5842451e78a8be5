"""GPS loggers as external sources: files by mission time, feeds by HTTP, bad rows counted."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from flying import FLAT, Flyer, hop, recorded, robot
from follow_world import Snapshot
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas import Environment
from aerodaas.analytics.monitoring.gps_logger import GpsLoggerAnalytics, parse_track
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import ConfigError, SourceError
from aerodaas.messages.odometry import GpsFix
from aerodaas.messages.readings import Alert
from aerodaas.recording.reader import Recording

GPX = """<?xml version="1.0"?>
<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1"><trk><trkseg>
<trkpt lat="13.0166" lon="77.5695"><ele>920.5</ele><time>2024-11-02T10:00:00Z</time><sat>9</sat>
</trkpt>
<trkpt lat="13.0167" lon="77.5696"><ele>921.0</ele><time>2024-11-02T10:00:02.5Z</time></trkpt>
<trkpt lat="ninety" lon="77.5696"><time>2024-11-02T10:00:03Z</time></trkpt>
<trkpt lat="13.0167" lon="77.5696"><time>2024-11-02T10:00:01Z</time></trkpt>
<trkpt lat="13.0168" lon="77.5697"><time>2024-11-02T10:00:05Z</time></trkpt>
</trkseg></trk></gpx>"""

TABLES = [
    """time,lat,lon,elevation,accuracy
2024-11-02T10:00:00Z,1.5,2.5,10,4
2024-11-02T10:00:01Z,1.6,2.6,11,4
""",
    """Date;Time (UTC);Latitude (deg);Longitude (deg);Altitude (m);Accuracy (m)
2024/11/02;10:00:00;1.5;2.5;10;4
2024/11/02;10:00:01;1.6;2.6;11;4
""",
    """# a logger's comment
timestamp\tlng\tlat\talt\tacc
1730541600000\t2.5\t1.5\t10\t4
1730541601000\t2.6\t1.6\t11\t4
""",
    """[{"time": 1730541600, "lat": 1.5, "lon": 2.5, "alt": 10, "accuracy": 4},
{"time": 1730541601, "lat": 1.6, "lon": 2.6, "alt": 11, "accuracy": 4}]""",
]


def at(second: float, alerts: list[Alert] | None = None) -> Snapshot:
    """The context at a second of mission time."""
    return Snapshot(round(second * NANOSECONDS), None, alerts if alerts is not None else [])


def told(logger: GpsLoggerAnalytics, seconds: list[float]) -> list[float | None]:
    """Latitudes told at these seconds."""
    fixes = [logger.process(None, at(second)) for second in seconds]
    return [None if fix is None else fix.latitude for fix in fixes]


def test_a_gpx_file_plays_by_mission_time(tmp_path: Path) -> None:
    """The first point is mission time zero; each is told once; bad and late rows are counted."""
    path = tmp_path / "vip.gpx"
    path.write_text(GPX)
    logger = GpsLoggerAnalytics(path)
    assert (logger.malformed, logger.stale) == (1, 1)
    assert told(logger, [0, 1, 2, 3, 4, 5, 6]) == [
        13.0166,
        None,
        None,
        13.0167,
        None,
        13.0168,
        None,
    ]
    assert told(GpsLoggerAnalytics(path, offset=1.0), [0, 1]) == [None, 13.0166]
    first = GpsLoggerAnalytics(path).process(None, at(0))
    assert first == GpsFix(13.0166, 77.5695, 920.5, satellites=9)


@pytest.mark.parametrize("text", TABLES)
def test_tables_are_told_by_their_columns(text: str) -> None:
    """Spellings, separators, units and times that loggers use."""
    track = parse_track(text, "log")
    assert track.malformed == 0
    assert [row.fix for row in track.rows] == [
        GpsFix(1.5, 2.5, 10.0, horizontal_sigma=4.0),
        GpsFix(1.6, 2.6, 11.0, horizontal_sigma=4.0),
    ]
    assert [row.time for row in track.rows] == [1730541600.0, 1730541601.0]


@pytest.mark.parametrize(
    "row", ["x,2,3", "91,2,3", "1,181,3", "nan,2,3", "0,0,0", "1", "", "1,inf,3", '"1', "\0,\0,\0"]
)
def test_a_malformed_row_is_counted_or_empty(row: str) -> None:
    """The rows around it are used."""
    track = parse_track(f"lat,lon,alt\n1,2,3\n{row}\n4,5,6\n", "log")
    assert track.rows[0].fix.latitude == 1.0
    assert len(track.rows) + track.malformed == (2 if not row else 3) or row == '"1'


def test_decimal_commas_are_malformed_and_not_other_places() -> None:
    """47,376,8,541 under lat,lon would be 47 N, 376 E, or with smaller numbers a place far off."""
    track = parse_track("lat,lon\n47,37,8,54\n47.37,8.54,\n", "log")
    assert [(row.fix.latitude, row.fix.longitude) for row in track.rows] == [(47.37, 8.54)]
    assert track.malformed == 1


def test_an_endless_field_costs_itself_only() -> None:
    """A quote that is never closed, and more behind it than a field may hold."""
    endless = "\n".join(['"', *["7,8,9"] * 40_000])
    track = parse_track(f"lat,lon,alt\n1,2,3\n{endless}", "log")
    assert track.rows[0].fix.latitude == 1.0
    assert track.malformed == 1


def test_a_heading_of_brackets_takes_no_time() -> None:
    """Units in brackets are looked for in one pass, not anew from each bracket."""
    begun = time.process_time()
    with pytest.raises(SourceError, match="no latitude"):
        parse_track("x" + "[" * 200_000 + ",lat\n1,2\n", "log")
    assert time.process_time() - begun < 2.0


@pytest.mark.parametrize("told", ["{}", "[]", "[" * 5000, '{"a": [1]}'])
def test_json_of_another_shape_is_refused_or_malformed(told: str) -> None:
    """A time that is no number or text, and nesting without an end."""
    with suppress(SourceError):
        track = parse_track(
            f'[{{"lat": 1, "lon": 2, "time": {told}}}, {{"lat": 1, "lon": 2}}]', "x"
        )
        assert (len(track.rows), track.malformed) == (1, 1)


def test_a_file_cut_short_is_used_up_to_there() -> None:
    """As when the logger's battery ran out."""
    track = parse_track(GPX[: GPX.index('<trkpt lat="13.0168"') + 30], "log")
    assert len(track.rows) == 2
    assert track.malformed >= 1


@given(st.text(max_size=200))
@settings(max_examples=40)
def test_any_text_is_read_or_refused(text: str) -> None:
    """Never another exception than SourceError."""
    for content in (text, f"lat,lon,time\n{text}", f"<gpx>{text}</gpx>", f'[{{"lat": {text}}}]'):
        with suppress(SourceError):
            parse_track(content, "log")


def test_what_cannot_be_a_log_is_refused_at_build_time(tmp_path: Path) -> None:
    """With the remedy."""
    with pytest.raises(SourceError, match="cannot read the GPS log"):
        GpsLoggerAnalytics(tmp_path / "none.gpx")
    for name, text, remedy in (
        ("a.csv", "a,b\n1,2\n", "give a GPX file"),
        ("b.csv", "lat,lon\nx,y\n", "no usable row"),
        ("c.gpx", "<svg></svg>", "without a track point"),
        ("d.gpx", '<!DOCTYPE x [<!ENTITY a "b">]><gpx/>', "no entities"),
        ("e.json", "{", "not JSON"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(SourceError, match=remedy):
            GpsLoggerAnalytics(tmp_path / name)
    with pytest.raises(ConfigError, match="rate must be above 0"):
        GpsLoggerAnalytics(tmp_path / "a.csv", rate=0.0)


@contextmanager
def feed(answers: list[str]) -> Iterator[str]:
    """A server on the loopback interface that gives one answer after the other, then errors."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            if not answers:
                self.send_error(503)
                return
            body = answers.pop(0).encode()
            self.send_response(200)
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base's
            """Keep quiet."""
            del format, args

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/gps"
    finally:
        server.shutdown()
        server.server_close()


def test_a_feed_tells_its_newest_row() -> None:
    """Old and repeated rows are not told, nonsense is counted, silence alerts once."""
    now = time.time()
    row = {"lat": 1.0, "lon": 2.0, "time": now}
    old = {"lat": 1.0, "lon": 2.0, "time": now - 3600}
    moved = {"lat": 1.1, "lon": 2.0, "time": now + 1}
    answers = [json.dumps(old), json.dumps(row), json.dumps(row), "<html>", json.dumps(moved)]
    alerts: list[Alert] = []
    with feed(answers) as address:
        logger = GpsLoggerAnalytics(address)
        logger.open()
        fixes = [logger.process(None, at(step, alerts)) for step in range(10)]
        logger.close()
    found = [None if fix is None else fix.latitude for fix in fixes]
    assert found == [None, 1.0, None, None, 1.1, None, None, None, None, None]
    assert (logger.stale, logger.failures) == (1, 6)
    assert [alert.kind for alert in alerts] == ["gps_feed_lost"]


def test_a_logger_flies_along_in_simulated_time(flyer: Flyer) -> None:
    """`instantiate()` puts the file's fixes into the recording at their mission times."""
    path = flyer.folder / "vip.gpx"
    path.write_text(GPX)

    def build(env: Environment) -> None:
        logger = GpsLoggerAnalytics(path, rate=2.0).deploy(env.get_compute_resource_by_id("edge"))
        logger.instantiate()
        env.get_robot_by_id("drone").navigate(hop((6.0, 0.0)))

    run = flyer.fly(build, {**FLAT, "robots": [robot()]})
    assert recorded(run).robots["drone"].outcome.startswith("landed")
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        places = [r for r in recording.records() if "gps_logger" in r.topic]
    assert len(places) == 3

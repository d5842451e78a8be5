"""Recordings: a whole container whose messages, metadata and attachments are not.

One input goes through everything that reads a recording: report, comparison, difference, lab,
exports and what a replay plays.
"""

from __future__ import annotations

import json
import random
import tempfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from aerodaas.cli.lab.recorded_workload import (
    RecordedWorkload,
    flown_trace,
    flown_workload,
)
from aerodaas.config.model import RecordingConfig, SensorConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.exports.track import write_gpx, write_kml
from aerodaas.extensions.exports.video import write_videos
from aerodaas.geometry.frames import CameraModel, GeodeticOrigin
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import Decision, MissionState, MissionStatus, SetpointRecord
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import PositionSetpoint, VehicleMode, VehicleState, VelocitySetpoint
from aerodaas.messages.vitals import GpuLoad, Vitals
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.recording.pictures import picture_topics
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_environment import left_out, recorded_content
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.replay.environment import read_timetables, replay_environment
from aerodaas.recording.replay.mcap_camera import McapCamera, ReplayedCamera
from aerodaas.recording.replay.vehicle import ReplayedVehicle
from aerodaas.recording.report.comparison import comparison_page
from aerodaas.recording.report.difference import difference
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.recording.report.moments import key_moments, picture_moments
from aerodaas.recording.report.page.figures import plots_of
from aerodaas.recording.report.page.flight import flight_page
from aerodaas.recording.report.report import Report
from aerodaas.recording.report.section import extension_sections
from aerodaas.recording.report.summary import FlightSummary
from aerodaas.recording.tables import write_csv

__all__ = ["mutate", "run", "seeds"]

_PLOTTED = 64
"""One input of so many is drawn, too: plots take a hundred times as long as all the rest."""
_TABLES = 5
"""Channels of one input that are written as CSV."""
_WITH_DEPTH = 3
_WITH_ALERT = 4
_STEP = 500_000_000
_ENVIRONMENT = {
    "name": "field",
    "home": {"latitude": 12.97, "longitude": 77.59, "altitude": 900.0},
    "robots": [{"id": "drone", "sensors": [{"id": "camera", "settings": {"width": 32}}]}],
    "compute": [{"id": "edge"}, {"id": "cloud", "kind": "cloud", "executors": 2}],
    "schedulers": {"analytics": "dems", "tasks": {"finder": {"benefit": 3.0}}},
    "runtime_env": {"finder": {"packages": ["numpy"]}},
}
_ODD: tuple[Any, ...] = (
    None,
    True,
    0,
    -1,
    1 << 70,
    1e308,
    -1e-320,
    "",
    "$x_{$",
    "\ud800",
    "\x1b[2J\x00",
    "x" * 5000,
    [],
    {},
    [[[]]],
    {"x": {"y": None}},
    [1, "2", None],
    "9" * 400,
)


def seeds() -> Iterable[bytes]:
    """Short flights with pictures of each kind."""
    return [_seed("jpeg"), _seed("h264"), _seed("png"), _seed("none")]


def run(data: bytes) -> None:
    """Read one recording in every manner there is."""
    with tempfile.TemporaryDirectory(prefix="fuzz-recording-") as name:
        folder = Path(name)
        path = folder / "input.mcap"
        path.write_bytes(data)
        whole = folder / "whole.mcap"
        whole.write_bytes(_seed("jpeg"))
        check = zlib.crc32(data)
        plotted = check % _PLOTTED == 0
        for use in (_report, _exports, _replay, _lab):
            with suppress(AeroDaaSError):
                use(path, folder, plotted)
        with suppress(AeroDaaSError):
            pair = (path, whole) if check % 2 else (whole, path)
            json.dumps(difference(*pair).as_dict())


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change the inside of a container and close it again; now and then its bytes."""
    if _chance(rng, 0.1):
        return _flipped(data, rng)
    try:
        return _rebuilt(data, rng)
    except Exception:  # noqa: BLE001 - an input that is no container any more
        return _flipped(data, rng)


def _report(path: Path, _folder: Path, plotted: bool) -> None:  # noqa: FBT001
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording)
        moments = picture_moments(recording, key_moments(flight))
        summary = FlightSummary.of(recording, flight)
        sections = extension_sections(recording)
    plots = plots_of(flight, sections) if plotted else []
    report = Report(summary, plots, moments, sections)
    flight_page(summary, plots, moments, sections).encode()
    json.dumps(summary.as_dict()).encode()
    f"{summary}".encode()
    comparison_page("A", report, "B", report).encode()


def _exports(path: Path, folder: Path, plotted: bool) -> None:  # noqa: FBT001
    with Recording.open(path) as recording:
        for write in (write_gpx, write_kml):
            with suppress(AeroDaaSError):
                write(recording, folder)
        topics = list(recording.topics)
        chosen = random.Random(path.stat().st_size).sample(topics, min(len(topics), _TABLES))
        for topic in chosen:
            with suppress(AeroDaaSError):
                write_csv(recording, topic, folder)
        if plotted:
            write_videos(recording, folder / "videos")


def _replay(path: Path, _folder: Path, _plotted: bool) -> None:  # noqa: FBT001
    read_timetables(path)
    with Recording.open(path) as recording:
        topics = picture_topics(recording)
        for name in recording.attachments:
            with suppress(AeroDaaSError):
                recording.attachment(name)
    for topic in topics:
        settings = {"path": str(path), "topic": topic}
        sensor = SensorConfig(id="camera", driver="mcap", settings=settings)
        for kind in (McapCamera, ReplayedCamera):
            camera = kind(sensor, None)  # type: ignore[arg-type]
            try:
                camera.open()
                for turn in range(8):
                    camera.capture(turn * _STEP, None)
            except AeroDaaSError:
                pass
            finally:
                camera.close()
    with Recording.open(path) as recording:
        left_out(recorded_content(recording))
    config = replay_environment(path)
    for robot in config.robots:
        vehicle = ReplayedVehicle(robot, config)
        try:
            vehicle.connect()
            for turn in range(8):
                vehicle.advance_to(turn * _STEP)
                vehicle.read()
        finally:
            vehicle.close()


def _lab(path: Path, _folder: Path, _plotted: bool) -> None:  # noqa: FBT001
    flown = RecordedWorkload.read(path)
    workload = flown_workload(flown)
    flown_trace(flown, workload.tasks(0, random.Random(0)))


def _chance(rng: random.Random, share: float) -> bool:
    return rng.random() < share


def _flipped(data: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.randint(1, 8)):
        if changed:
            changed[rng.randrange(len(changed))] = rng.randrange(256)
    if _chance(rng, 0.2):
        del changed[rng.randrange(len(changed) + 1) :]
    return bytes(changed)


def _changed(data: bytes, rng: random.Random) -> bytes:
    """One message, changed as what it is: JSON by its tree, anything else by its bytes."""
    try:
        value = json.loads(data)
    except ValueError:
        return _flipped(data, rng)
    if _chance(rng, 0.1):
        return _flipped(data, rng)
    return json.dumps(_twisted(value, rng)).encode()


def _twisted(value: Any, rng: random.Random) -> Any:  # noqa: ANN401 - any JSON
    if not value or not isinstance(value, dict | list) or _chance(rng, 0.15):
        return rng.choice(_ODD)
    key = rng.choice(list(value)) if isinstance(value, dict) else rng.randrange(len(value))
    copy: Any = value.copy()
    if _chance(rng, 0.15):
        del copy[key]
    elif _chance(rng, 0.12) and isinstance(copy, list):
        copy = copy * rng.choice((2, 30))
    elif _chance(rng, 0.06) and isinstance(copy, dict):
        copy[rng.choice(("stamp", "robot", "x", "brand_new", ""))] = rng.choice(_ODD)
    else:
        copy[key] = _twisted(copy[key], rng)
    return copy


def _rebuilt(data: bytes, rng: random.Random) -> bytes:  # noqa: C901 - a container's parts in order
    reader = make_reader(BytesIO(data))
    found = list(reader.iter_messages())
    chosen = set(rng.sample(range(len(found)), min(len(found), rng.choice((1, 1, 2, 5, 40)))))
    if _chance(rng, 0.15):
        chosen = set()
    file = BytesIO()
    kind = rng.choice((CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE))
    writer = Writer(file, compression=kind, chunk_size=rng.choice((200, 1 << 20)))
    writer.start()
    for metadata in reader.iter_metadata():
        fields = dict(metadata.metadata)
        if fields and _chance(rng, 0.1):
            fields[rng.choice(list(fields))] = rng.choice(
                ("", "-1", "9" * 40, "\x1b[2J", "x" * 999)
            )
        writer.add_metadata(metadata.name, fields)
    for attachment in reader.iter_attachments():
        body = attachment.data if _chance(rng, 0.8) else _changed(attachment.data, rng)
        writer.add_attachment(1, 1, attachment.name, attachment.media_type, body)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    bad_schema = _chance(rng, 0.1)
    for number, (schema, channel, message) in enumerate(found):
        if channel.id not in channels:
            known = 0
            if schema is not None:
                if schema.id not in schemas:
                    spoil = bad_schema and _chance(rng, 0.3)
                    body = _flipped(schema.data, rng) if spoil else schema.data
                    name = rng.choice(found)[0] if spoil and _chance(rng, 0.3) else schema
                    schemas[schema.id] = writer.register_schema(
                        (name or schema).name, schema.encoding, body
                    )
                known = schemas[schema.id]
            encoding = channel.message_encoding
            if _chance(rng, 0.005):
                encoding = rng.choice(("json", "protobuf", "cdr", ""))
            channels[channel.id] = writer.register_channel(channel.topic, encoding, known)
        body = _changed(message.data, rng) if number in chosen else message.data
        times = [message.log_time, message.publish_time]
        if number in chosen and _chance(rng, 0.1):
            times[rng.randrange(2)] = rng.choice((0, 1, (1 << 63) - 1, (1 << 64) - 1))
        writer.add_message(channels[channel.id], times[0], body, times[1], message.sequence)
    writer.finish()
    return file.getvalue()


@cache
def _seed(images: str) -> bytes:
    with tempfile.TemporaryDirectory(prefix="fuzz-recording-") as name:
        path = Path(name) / "flight.mcap"
        provenance = Provenance(
            started_ns=1_750_000_000_000_000_000,
            name="seed",
            seed=1,
            config=json.dumps(_ENVIRONMENT),
            app="seed.py",
            app_source="fly()\n",
        )
        config = RecordingConfig.model_validate({"images": images})
        home = GeodeticOrigin(12.97, 77.59, 900.0)
        with FlightRecorder(path, config=config, provenance=provenance, home=home) as recorder:
            for message in _messages():
                recorder.write(message)
            recorder.drops("drone/camera", 2)
        return path.read_bytes()


def _messages() -> Iterator[Message[Any]]:
    camera = CameraModel.from_fov(32, 24, 1.4)
    states = (MissionState.PREFLIGHT, MissionState.ENROUTE, MissionState.LANDED)
    plan = (Waypoint("north", 0, 4, 2), Waypoint("east", 4, 0, 2))
    for turn in range(6):
        stamp = turn * _STEP
        at = np.array([turn, turn / 2, 2.0])
        odometry = Odometry(at, np.array([1.0, 0.5, 0.0]), 0.1)
        state = VehicleState(
            stamp,
            odometry,
            Battery(0.9 - turn / 100, 15.0, 3.0),
            VehicleMode.GUIDED,
            armed=True,
            gps=GpsFix(12.97, 77.59, 902.0, 1.0, 2.0, 12),
            truth=odometry,
        )
        yield _message("drone/@state", turn, stamp, state)
        status = MissionStatus(
            stamp, states[turn // 2], "so", plan[0], plan[1:], ("a",), (), turn, visits=1
        )
        yield _message("drone/@status", turn, stamp, status)
        asked = PositionSetpoint(at, None, 1.0)
        sent = VelocitySetpoint(odometry.velocity)
        record = SetpointRecord(stamp, asked, sent, ("max_speed",))
        yield _message("drone/@setpoints", turn, stamp, record)
        begun = 10**12 + stamp
        spans = (
            TraceSpan("camera", begun + 10, begun + 20),
            TraceSpan("finder", begun + 30, begun + 90),
        )
        header = Header(turn, stamp, "drone/camera")
        frame = Frame(header, np.full((24, 32, 3), 40 * turn, np.uint8), camera, odometry)
        if turn == _WITH_DEPTH:
            frame = replace(frame, depth=np.full((24, 32), 900, np.uint16))
        yield _message("drone/camera", turn, stamp, frame, spans[:1], begun)
        points = np.full((3, 3), 8.0, np.float32)
        found = Detections.of(frame, [Detection((4.0, 4.0, 9.0, 9.0), "person", 0.9, 3, points)])
        yield _message("drone/finder", turn, stamp, found, spans, begun)
        command = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [VelocityCommand(0.2)])
        yield _message("drone/follow", turn, stamp, command, spans, begun)
        yield _message("drone/free", turn, stamp, {"any": [turn, "thing"]}, spans, begun)
        task = f"drone/finder#drone/camera:{turn}"
        waited = {"waited_ms": 3.0, "number": float(turn), "qos_total": 2.0}
        yield _message("dispatcher", turn, stamp, Decision(stamp, task, "edge", "in time", waited))
        done = Decision(stamp + 9, task, "done", "edge: in time", waited)
        yield _message("dispatcher", turn, stamp + 9, done)
        vitals = Vitals(begun, float(turn), 10**8, 0.4, 0.5, (GpuLoad(0.1, 0.2),))
        yield Message("vitals/drone", turn, stamp, Header(turn, stamp, "drone@here"), 0, (), vitals)
        if turn == _WITH_ALERT:
            alert = Alert(header, "low", "the battery is low", {"fraction": 0.2})
            yield _message("drone/monitor", turn, stamp, alert)


def _message(
    stream: str,
    number: int,
    stamp: int,
    item: object,
    spans: tuple[TraceSpan, ...] = (),
    captured: int = 0,
) -> Message[Any]:
    return Message(stream, number, stamp, Header(number, stamp, stream), captured, spans, item)

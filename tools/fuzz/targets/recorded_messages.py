"""Messages of a recording, one at a time: the name of its schema, a blank, and its JSON."""

from __future__ import annotations

import contextlib
import json
import random
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.reader import make_reader
from mcap.records import Channel, Schema

from aerodaas.config.model import GeofenceConfig, RecordingConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.detections import Detection, Detections
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import (
    BatteryOutlook,
    Decision,
    MissionState,
    MissionStatus,
    SetpointRecord,
)
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.payload import GimbalAttitude, Photo, PhotoPlace
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import (
    PositionSetpoint,
    Traffic,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from aerodaas.messages.vitals import GpuLoad, Vitals
from aerodaas.messages.waypoints import FollowedTarget, TargetState, VelocityCommand, Waypoint
from aerodaas.recording.decoding.messages import BrokenMessageError, MessageDecoder
from aerodaas.recording.messages import CHANNELS, json_entry, labels_and_message
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.recorder import FlightRecorder
from tools.fuzz.json_changes import change_value, flip_byte

__all__ = ["mutate", "run", "seeds"]

_FORMATS = ("1", "2")
_BYTES = 0.2
"""Share of mutations that change a byte."""


@cache
def seeds() -> Iterable[bytes]:
    """One message of each channel, as it is recorded."""
    with TemporaryDirectory(prefix="fuzz-messages-") as name:
        path = Path(name) / "seeds.mcap"
        fences = {"drone": GeofenceConfig(polygon=[(0, 0), (1, 0), (1, 1)])}
        with FlightRecorder(
            path, config=RecordingConfig(), provenance=Provenance(), fences=fences
        ) as recorder:
            for seq, item in enumerate(_items()):
                spans = (TraceSpan("a", 1, 2), TraceSpan("b", 3, 4))
                header = Header(seq, 2, "drone/cam")
                recorder.write(Message("drone/it", seq, 3, header, 0, spans, item))
            recorder.drops("drone/cam")
        with path.open("rb") as file:
            found = {
                schema.name: f"{schema.name} ".encode() + message.data
                for schema, _, message in make_reader(file).iter_messages()
                if schema is not None and schema.name in CHANNELS
            }
    return list(found.values())


def _items() -> Iterable[object]:
    header, pose = Header(1, 2, "drone/cam"), Odometry(np.ones(3), np.ones(3), 0.5)
    there = Waypoint("a", 1, 2, 3, yaw=0.5, look_at=(1.0, 2.0, 3.0))
    target = FollowedTarget(TargetState.SURE, (1.0, 2.0, 3.0, 4.0), 5)
    points = np.zeros((3, 3), np.float32)
    person = Detection((0.0, 1.0, 2.0, 3.0), "person", 0.5, 1, points, 4.0)
    return (
        VehicleState(
            1,
            pose,
            Battery(0.5),
            VehicleMode.GUIDED,
            armed=True,
            gps=GpsFix(1.0, 2.0, 3.0, satellites=7),
            truth=pose,
            extra={"link": 0.5},
            gimbal=GimbalAttitude(1, -1.0, 0.0),
            traffic=(Traffic(7, "DLH4", np.ones(3), np.ones(3)),),
            actuators={"hook": "release"},
        ),
        MissionStatus(
            1, MissionState.ENROUTE, "", there, (there,), outlook=BatteryOutlook(0.1, 0.2, 3.0)
        ),
        SetpointRecord(
            1, PositionSetpoint(np.ones(3)), VelocitySetpoint(np.ones(3)), ("speed",), header
        ),
        Photo(1, 2, "a", PhotoPlace(1.0, 2.0, None), pose, zoom=5.0),
        Battery(0.5),
        Frame(header, np.zeros((4, 6, 3), np.uint8), odometry=pose),
        Detections(header, (person,), 64, 48),
        AeroNavigation(data=[there, VelocityCommand(1.0, target=target)]),
        Decision(1, "m#1", "edge", "in time", {"slack": 0.1}),
        Alert(header, "kind", "text", {"a": [1, {"b": None}]}),
        Vitals(1, 0.5, 2, 0.1, 0.2, (GpuLoad(0.1, 0.2),)),
        {"own": [1.5, "x"]},
    )


def run(data: bytes) -> None:
    """Read a message in each format; what was read is written and read again, the same."""
    name, _, text = data.partition(b" ")
    schema = Schema(1, text, "jsonschema", name.decode(errors="replace"))
    channel = Channel(1, "/it", "json", {}, 1)
    for recorded_format in _FORMATS:
        with contextlib.suppress(BrokenMessageError):
            _, message = MessageDecoder(recorded_format).decode(channel, schema, text)
            if schema.name in CHANNELS:
                entry = json_entry(message, "it", 1, robot="drone")
                _, again = labels_and_message(schema.name, entry.data)
                if again != message:
                    raise AssertionError(f"{message!r} became {again!r}")


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change one value of the JSON, or a byte."""
    name, blank, text = data.partition(b" ")
    try:
        content = json.loads(text)
        if rng.random() >= _BYTES and change_value(content, rng):
            return name + blank + json.dumps(content).encode()
    except (ValueError, RecursionError):  # it is no JSON any more, or holds itself
        pass
    return name + blank + flip_byte(text, rng)

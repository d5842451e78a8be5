"""Classes in messages: named where the run knows them, carried where not, built once."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from aerodaas.actors.streams import UnreadableError
from aerodaas.actors.streams.codec import Encoded, UnsendableError, decode
from aerodaas.messages.detections import Detection
from aerodaas.messages.envelope import Message, TraceSpan
from aerodaas.messages.frames import Header
from aerodaas.messages.waypoints import Waypoint

READER = """
import pickle, sys
from aerodaas.actors.streams import decode_message
blobs = pickle.load(sys.stdin.buffer)
application = pickle.loads(blobs.pop(0))
items = [decode_message(memoryview(blob)).item for blob in blobs]
print(len({id(type(item)) for item in items}), [item.value for item in items])
print(sum(len(blob) for blob in blobs) // len(blobs))
"""
SENDER = """
import pickle, subprocess, sys
from aerodaas.actors.run.application import capture
from aerodaas.actors.streams import encode_message
from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.frames import Header
from aerodaas.dataflow.graph import Graph
from aerodaas.messages.envelope import Message
class Known:
    def __init__(self, value):
        self.value = value
application = capture(Graph(), EnvironmentConfig(robots=[{"id": "d"}]))
class Unknown(Known):
    pass
def sent(item):
    return encode_message(Message(type(item).__name__, 0, 0, Header(0, 0, "s"), 0, (), item))
sys.modules["__main__"] = sys  # as in an actor: nobody finds the class there
for kind in (Known, Unknown):
    blobs = [pickle.dumps(application), *(sent(kind(n)) for n in range(3))]
    print(subprocess.run(
        [sys.executable, "-c", sys.argv[1]], input=pickle.dumps(blobs), capture_output=True
    ).stdout.decode())
"""


def test_a_known_class_is_named_and_any_class_is_built_once(tmp_path: Path) -> None:
    """Messages of a class that the run knows carry its name; others its definition."""
    script = tmp_path / "sender.py"
    script.write_text(SENDER)
    done = subprocess.run(
        [sys.executable, str(script), READER], capture_output=True, text=True, check=True
    )
    known, size, unknown, larger = done.stdout.split("\n")[:2] + done.stdout.split("\n")[3:5]
    assert known == unknown == "1 [0, 1, 2]"
    assert int(size) < 400 < int(larger)


def _message(item: object) -> Message[object]:
    return Message("s", 3, 5, Header(1, 2, "cam"), 7, (TraceSpan("a", 1, 2),), item)


class Fragile:
    """Cannot be rebuilt."""

    def __setstate__(self, state: object) -> None:
        """Raise."""
        raise RuntimeError("broken")

    def __getstate__(self) -> dict[str, int]:
        """Have something to set."""
        return {"a": 1}


def test_the_envelope_is_read_whatever_the_item_is() -> None:
    """What cannot be rebuilt costs the item, and says its class and why."""
    with pytest.raises(UnreadableError, match="Fragile from s: RuntimeError: broken") as caught:
        decode(memoryview(Encoded(_message(Fragile())).to_bytes()))
    assert caught.value.message == _message(None)


def test_what_cannot_be_pickled_is_refused_by_name() -> None:
    """The part of it that is at fault is named, however deep."""
    with pytest.raises(UnsendableError, match="a dict cannot be sent: its element 1, a generator"):
        Encoded(_message({"a": [1, (n for n in range(3))]}))


@dataclass(frozen=True)
class Leaf(Detection):
    """A detection that says more."""

    green: float = 0.0


class Station(Waypoint):
    """A waypoint with an attribute that its constructor does not know."""


def test_records_of_derived_classes_keep_what_they_add() -> None:
    """A class derived from one of the project's records travels whole."""
    leaf = Leaf((0, 0, 1, 1), "leaf", 0.5, green=0.7)
    again = decode(memoryview(Encoded(_message(leaf)).to_bytes())).item
    assert isinstance(again, Leaf)
    assert (again.box, again.label, again.green) == (leaf.box, "leaf", 0.7)
    station = Station("a", 1, 2, 3)
    object.__setattr__(station, "charger", np.arange(3))
    kept = decode(memoryview(Encoded(_message(station)).to_bytes())).item
    assert list(vars(kept)["charger"]) == [0, 1, 2]

"""Classes in messages: those of the application's own file are built once in each process."""

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
argument, *messages = pickle.load(sys.stdin.buffer)
def read(data):
    return decode_message(memoryview(data)).item
argument = pickle.loads(argument)
first = read(messages[0])
type(first).seen = 1
items = [first, *map(read, messages)]
print(len({id(type(item)) for item in (argument, *items)}), [item.value for item in items])
print(type(items[0]).seen, items[0].double(), items[0].kind is type(items[0].kind).LARGE)
"""
SENDER = """
import enum, pickle, subprocess, sys
from ray import cloudpickle
from aerodaas.actors.streams import encode_message
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
class Kind(enum.Enum):
    SMALL, LARGE = range(2)
class Item:
    seen = 0
    def __init__(self, value):
        self.value, self.kind = value, Kind.LARGE
    def double(self):
        return factor * self.value
factor = 2
def sent(item):
    return encode_message(Message("s", 0, 0, Header(0, 0, "s"), 0, (), item))
argument = cloudpickle.dumps(Item(9))
messages = [sent(Item(n)) for n in range(1, 4)]
print(subprocess.run(
    [sys.executable, "-c", sys.argv[1]],
    input=pickle.dumps([argument, *messages]), stdout=subprocess.PIPE, check=True,
).stdout.decode())
"""


def test_a_class_of_the_applications_file_is_built_once(tmp_path: Path) -> None:
    """Of messages and of what an actor is made with, it is one; what is set on it stays."""
    script = tmp_path / "sender.py"
    script.write_text(SENDER)
    done = subprocess.run(
        [sys.executable, str(script), READER], capture_output=True, text=True, check=True
    )
    assert done.stdout.split("\n")[:2] == ["1 [1, 1, 2, 3]", "1 2 True"]


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

"""Whatever class an application gives its results, they reach everyone who reads them."""

from __future__ import annotations

from pathlib import Path

import pytest
from stranger import COMMAND, FLY, HEAD, Flown, fly, run, write

KINDS = """
import enum
from dataclasses import dataclass, field
from typing import Generic, NamedTuple, TypeVar

import pydantic

from aerodaas.messages.detections import Detection
from aerodaas.messages.frames import Header
from kit import Oblong
from shapes import Round

T = TypeVar("T")


class Plain:
    class Inner:
        def __init__(self):
            self.depth = 2

    def __init__(self, value):
        self.value = value
        self.inner = Plain.Inner()


@dataclass
class Data:
    value: float


@dataclass(frozen=True, slots=True)
class Slotted:
    value: float
    data: Data = field(default_factory=lambda: Data(2.0))


class Named(NamedTuple):
    value: float
    data: Data


class Light(enum.Enum):
    DARK = 1
    BRIGHT = 2


class Model(pydantic.BaseModel):
    value: float
    light: Light = Light.BRIGHT


class Box(Generic[T]):
    def __init__(self, value: T):
        self.value = value


@dataclass(frozen=True)
class Leaf(Detection):
    green: float = 0.0


def local():
    @dataclass
    class Local:
        value: float

    return Local


MAKE = {
    "plain": Plain, "data": Data, "slotted": Slotted, "named": lambda v: Named(v, Data(v)),
    "light": lambda v: Light.BRIGHT, "model": lambda v: Model(value=v), "box": Box[float],
    "leaf": lambda v: Leaf((0, 0, 1, 1), "leaf", 0.5, green=v), "local": local(),
    "round": Round, "oblong": Oblong,
}
KIND = {"named": Named, "light": Light, "model": Model, "box": Box, "leaf": Leaf}


class Make(Analytics[object]):
    def __init__(self, kind):
        self.name = self.kind = kind

    def process(self, item, context):
        return MAKE[self.kind](3.0)


class Verdict:
    def __init__(self, kind, same):
        self.kind, self.same = kind, same


class Judge(Analytics[Verdict]):
    isolated = True  # in a process of its own

    def process(self, item, context):
        for kind in MAKE:
            if isinstance(item, KIND.get(kind, MAKE[kind])):
                return Verdict(kind, True)
        return Verdict(type(item).__name__, False)


class Listen(Analytics[str]):
    isolated = True

    def process(self, item, context):
        return f"{item.kind} {item.same} {isinstance(item, Verdict)}"
"""
SHAPES = """
from __future__ import annotations
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kit.oblong import Oblong


class Round:
    def __init__(self, radius: float, like: Oblong | None = None):
        self.radius = radius
"""
OBLONG = """
from dataclasses import dataclass

from . import sides


@dataclass
class Oblong:
    side: float

    def turned(self):
        return sides.turned(self)
"""
SIDES = """
def turned(oblong):
    from .oblong import Oblong
    return Oblong(-oblong.side)
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """One flight in simulated time with results of every kind, read in two more processes."""
    folder = tmp_path_factory.mktemp("kinds")
    graph = """
judges = [Judge(), Judge()]
listen = Listen().deploy(edge)
for number, kind in enumerate(MAKE):
    judge = judges[number % 2].deploy(edge)
    verdicts = judge.analyse(Make(kind).deploy(edge).analyse(camera))
    listen.analyse(verdicts)
"""
    write(
        folder,
        {
            "kinds.py": HEAD + KINDS + graph + FLY,
            "shapes.py": SHAPES,
            "kit/__init__.py": "from .oblong import Oblong",
            "kit/oblong.py": OBLONG,
            "kit/sides.py": SIDES,
        },
    )
    return fly(folder, "kinds.py")


def test_a_flight_with_results_of_every_kind_goes_as_planned(flown: Flown) -> None:
    """Nobody waits for a reader, and nobody has anything to complain of."""
    assert flown.code == 0, flown.said
    assert flown.landed_as_planned(), flown.said
    assert flown.alerts() == []


RECORDED: list[tuple[str, object]] = [
    ("plain", {"value": 3.0, "inner": {"depth": 2}}),
    ("data", {"value": 3.0}),
    ("slotted", {"value": 3.0, "data": {"value": 2.0}}),
    ("named", {"value": 3.0, "data": {"value": 3.0}}),
    ("light", "BRIGHT"),
    ("model", {"value": 3.0, "light": "BRIGHT"}),
    ("box", {"value": 3.0}),
    ("local", {"value": 3.0}),
    ("round", {"radius": 3.0}),
    ("oblong", {"side": 3.0}),
]


@pytest.mark.parametrize(("kind", "content"), RECORDED)
def test_results_are_recorded_by_class_and_fields(flown: Flown, kind: str, content: object) -> None:
    """The recorder, which knows none of these classes, writes what they hold."""
    values = flown.values(f"drone/{kind}")
    assert len(values) > 20
    assert all(one == (kind.capitalize(), content) for one in values)


def test_classes_are_the_same_in_every_process(flown: Flown) -> None:
    """A reader in another process may ask `isinstance`, and so may a reader of that reader."""
    values = [*flown.values("drone/judge"), *flown.values("drone/judge_2")]
    judged = {one["kind"]: one["same"] for _, one in values}
    kinds = [
        "plain",
        "data",
        "slotted",
        "named",
        "light",
        "model",
        "box",
        "leaf",
        "local",
        "round",
        "oblong",
    ]
    assert judged == dict.fromkeys(kinds, True)
    assert flown.lines("drone/listen") == {f"{kind} True True" for kind in kinds}


@pytest.mark.slow
def test_a_recording_of_unknown_classes_can_be_used(flown: Flown, tmp_path: Path) -> None:
    """Report, export and replay work on it, and nothing in it is executed."""
    folder, recording = flown.recording.parents[2], str(flown.recording)
    assert b"cloudpickle" not in flown.recording.read_bytes()
    for words in (
        ["report", recording],
        ["export", "csv", recording, "/drone/plain/value", "--out", str(tmp_path)],
        ["replay", recording, "--app", "kinds.py", "--out", str(tmp_path / "again")],
    ):
        done = run(folder, str(COMMAND), *words)
        assert done.returncode == 0, f"{words}: {done.stdout}{done.stderr}"
    again = Flown(0, "", tmp_path / "again" / "flight.mcap")
    assert again.values("drone/plain") == flown.values("drone/plain")

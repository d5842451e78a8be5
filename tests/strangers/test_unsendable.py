"""What cannot be sent or read is said by name, at once, and costs only whoever wanted it."""

from __future__ import annotations

from pathlib import Path

import pytest
from stranger import COMMAND, FLY, HEAD, Flown, fly, run, write

pytestmark = pytest.mark.slow

BAD = """
import threading


class Inner:
    def __init__(self):
        self.lock = threading.Lock()


class Locked:
    def __init__(self):
        self.inner = Inner()


class Picky(Exception):
    def __init__(self, first, second):
        super().__init__(first)




class Lock(Analytics[Locked]):
    def process(self, item, context):
        return Locked()


class Stream(Analytics[object]):
    def process(self, item, context):
        yield item


class Raise(Analytics[Picky]):
    def process(self, item, context):
        return Picky("one", "two")


class Whole(Analytics[float]):
    def process(self, item, context):
        return float(item.image.mean())


class Told(Analytics[float]):
    def process(self, item, context):
        from aerodaas import Alert
        context.alert(Alert(item.header, "odd", "with a lock", {"lock": threading.Lock()}))
        return 2.0


class Apart(Analytics[float]):
    isolated = True

    def process(self, item, context):
        return 1.0


class After(Apart):
    pass
"""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    """One flight in real time in which most results cannot be sent to another actor, or read."""
    folder = tmp_path_factory.mktemp("bad")
    graph = """
for kind in (Whole, Told):
    kind().deploy(edge).analyse(camera)
for kind in (Lock, Stream):
    Apart().deploy(edge).analyse(kind().deploy(edge).analyse(camera))
After().deploy(edge).analyse(Raise().deploy(edge).analyse(camera))
"""
    write(folder, {"bad.py": HEAD + BAD + graph + FLY})
    return fly(folder, "bad.py", "--speed", "2")


def test_the_flight_goes_on(flown: Flown) -> None:
    """The mission is flown as planned, nobody is given up, and other results are recorded."""
    assert flown.landed_as_planned(), flown.said
    assert "no reader answers" not in flown.said
    assert {kind for kind, _ in flown.values("drone/whole")} == {"float"}
    assert [value for _, value in flown.values("drone/told")][:3] == [2.0] * 3


TOLD = (
    "Lock's result: Locked cannot be sent: its attribute 'lock', a lock: cannot pickle '_thread.",
    "Stream's result: a generator cannot be sent: cannot pickle 'generator' object",
    "After cannot read Picky from drone/raise: TypeError: ",
    "with a lock",
)


@pytest.mark.parametrize("text", TOLD)
def test_people_are_told_by_name(flown: Flown, text: str) -> None:
    """Whose item it is, what of it, and who lacks it; in the recording and on the terminal."""
    told = [one for one in flown.alerts() if one.startswith(text)]
    assert told, flown.alerts()
    assert text in " ".join(flown.said.split())


def test_people_are_told_once(flown: Flown) -> None:
    """An item 5 times a second is one alert."""
    told = [one for one in flown.alerts() if "cannot be" in one or "cannot read" in one]
    assert len(told) == len(set(told)) == 3


def test_the_end_is_an_error(flown: Flown) -> None:
    """Who did not watch learns it from the exit code and the last line."""
    assert flown.code == 1


ATTRIBUTE = """
class Open(Analytics[float]):
    def __init__(self):
        self.file = open("log.txt", "w")
Open().deploy(edge).analyse(camera)
"""
GLOBAL = """
import threading
lock = threading.Lock()
class Global(Analytics[float]):
    def process(self, item, context):
        with lock:
            return 1.0
Global().deploy(edge).analyse(camera)
"""
CONDITION = """
import threading

lock = threading.Lock()
class Fine(Analytics[float]):
    pass
fine = Fine().deploy(edge)
fine.analyse(camera)
fine.trigger(drone.end_mission, when=lambda result: lock.locked())
"""
REFUSED = {
    ATTRIBUTE: "Open (drone/open) runs in a process of its own: Open cannot be sent: its "
    "attribute 'file', a TextIOWrapper",
    GLOBAL: "its global 'lock' (used by Global.process), a lock",
    CONDITION: "the condition of drone/fine's trigger",
}


@pytest.mark.parametrize("graph", REFUSED, ids=["attribute", "global", "condition"])
def test_an_analysis_that_cannot_be_sent_is_refused(tmp_path: Path, graph: str) -> None:
    """Before anything starts, with the name of what cannot travel."""
    write(tmp_path, {"app.py": HEAD + graph + FLY})
    done = run(tmp_path, str(COMMAND), "run", "app.py")
    assert done.returncode == 2
    assert REFUSED[graph] in " ".join(done.stderr.split())
    assert not list(tmp_path.rglob("*.mcap"))

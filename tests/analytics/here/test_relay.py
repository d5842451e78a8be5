"""Stand-ins, relay and the user's side: what each does when another one fails."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodaas.analytics.here.analysis import (
    AnsweredCondition,
    HereAnalysis,
    HereConditions,
    HereSite,
)
from aerodaas.analytics.here.relay import LARGEST_ANSWER, HereRelay, HereUser
from aerodaas.analytics.wire_items import item_json, pack
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError, ModelError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.readings import Alert, Readings
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.messages.vehicle import VehicleState

READINGS = Readings(5, {"height": 2.0})


class Flight:
    """Context of a stand-in."""

    kind: Any = "edge"

    def __init__(self) -> None:
        self.alerts: list[Alert] = []

    def now(self) -> int:
        """Seven nanoseconds."""
        return 7

    def vehicle(self) -> VehicleState | None:
        """No state yet."""
        return None

    def alert(self, alert: Alert) -> None:
        """Keep it."""
        self.alerts.append(alert)


class User:
    """A user's side that answers each question as it is told, at once or later."""

    def __init__(self, relay: HereRelay) -> None:
        self.asked: list[tuple[dict[str, Any], bytes]] = []
        self.came = threading.Semaphore(0)
        self.say: Callable[[dict[str, Any]], dict[str, Any]] | None = None
        self.connection: HereUser = relay.attach(self._take)

    def _take(self, question: dict[str, Any], blob: bytes) -> None:
        self.asked.append((question, blob))
        if self.say is not None:
            answer = {**self.say(question), "number": question["number"]}
            threading.Thread(target=self.connection.answered, args=(answer, b"")).start()
        self.came.release()

    def answer(self, number: int, **words: Any) -> None:  # noqa: ANN401 - JSON
        """Answer the question asked as `number`, counted from 0."""
        self.connection.answered({**words, "number": self.asked[number][0]["number"]})


@pytest.fixture
def relay(tmp_path: Path) -> Iterator[HereRelay]:
    """A relay that waits a fifth of a second for each answer."""
    made = HereRelay(tmp_path / "here.sock", seconds=0.2)
    made.start()
    yield made
    made.close()


@pytest.fixture
def patient(tmp_path: Path) -> Iterator[HereRelay]:
    """A relay that waits longer than a test takes."""
    made = HereRelay(tmp_path / "patient.sock", seconds=60.0)
    made.start()
    yield made
    made.close()


def stand_in(relay: HereRelay, produces: type = object, key: str = "drone/a") -> HereAnalysis:
    """An open stand-in of the relay's flight."""
    made = HereAnalysis(key, HereSite(relay.path), produces)
    made.open()
    return made


def echo(question: dict[str, Any]) -> dict[str, Any]:
    """The item itself as the result."""
    return {"item": question["item"]}


def test_a_question_goes_there_and_its_answer_comes_back(patient: HereRelay) -> None:
    """With the item, the time, and the conditions that were met."""
    user = User(patient)
    alerts = [
        {"text": "low: too low", "values": {"up": 0.5, "odd": [1], "at": "home"}},
        "words alone",
    ]
    user.say = lambda asked: {**echo(asked), "fired": [1], "alerts": alerts, "took": 0.0}
    work, flight = stand_in(patient, Readings), Flight()
    assert work.process(READINGS, flight) == READINGS
    ((question, _),) = user.asked
    assert question["item"] == pack(READINGS)[0]
    assert (question["do"], question["key"], question["now"]) == ("process", "drone/a", 7)
    assert [AnsweredCondition("drone/a", number)(READINGS) for number in (0, 1)] == [0, 1]
    assert [(one.kind, one.text, one.values) for one in flight.alerts] == [
        ("here", "here: low: too low", {"up": 0.5, "at": "home"}),
        ("here", "here: words alone", {}),
    ]
    times = patient.times()["drone/a"]
    assert (times.answers, times.missed) == (1, 0)
    assert 0 < times.newest == times.longest == times.total


def test_alerts_beyond_the_most_are_told_of_once(patient: HereRelay) -> None:
    """A hundred of one analysis in a flight, and then what becomes of the others."""
    user = User(patient)
    alerts = [{"text": f"low: {number}", "values": {}} for number in range(60)]
    user.say = lambda asked: {**echo(asked), "alerts": alerts}
    work, flight = stand_in(patient), Flight()
    for number in range(4):
        assert work.process(number, flight) == number
    assert len(flight.alerts) == 101
    assert flight.alerts[99].text == "here: low: 39"
    assert flight.alerts[100].text == (
        "here: drone/a has told 100 alerts, the most of one analysis: its next ones are left out"
    )


@pytest.mark.parametrize("lossless", [False, True])
def test_a_frame_goes_as_a_picture(patient: HereRelay, *, lossless: bool) -> None:
    """As JPEG, or as PNG for a flight that is to be repeated."""
    user = User(patient)
    user.say = lambda _: {"item": None}
    work = HereAnalysis("drone/a", HereSite(patient.path, lossless=lossless))
    work.open()
    work.process(Frame(Header(1, 2, "cam"), np.zeros((8, 8, 3), np.uint8)), Flight())
    content, blob = user.asked[0]
    assert blob.startswith(b"\x89PNG" if lossless else b"\xff\xd8")
    assert len(blob) == content["item"]["of"]["picture"]


def test_a_missing_user_is_told_once_and_may_come_back(relay: HereRelay) -> None:
    """Until then, and from then on, there are no errors."""
    work, flight = stand_in(relay), Flight()
    with pytest.raises(ModelError, match=r"drone/a has no results: .*not connected"):
        work.process(1, flight)
    assert work.process(2, flight) is None
    user = User(relay)
    assert relay.wait_attached(0.0)
    user.say = echo
    assert work.process(3, flight) == 3
    user.connection.detach()
    assert not relay.wait_attached(0.0)
    with pytest.raises(ModelError, match="not connected"):
        work.process(4, flight)
    assert relay.times()["drone/a"].missed == 3


def test_a_hung_user_is_asked_no_more_until_it_has_answered(relay: HereRelay) -> None:
    """Only the analysis that hangs: others go on; the late answer is nobody's result."""
    user, flight = User(relay), Flight()
    work, other = stand_in(relay), stand_in(relay, key="drone/b")
    with pytest.raises(ModelError, match=r"no answer in 0\.2 s"):
        work.process(1, flight)
    assert work.process(2, flight) is None
    assert len(user.asked) == 1
    user.say = echo
    assert other.process(3, flight) == 3
    user.answer(0, item=1)
    assert work.process(4, flight) == 4


def test_a_user_that_leaves_keeps_nobody_waiting(patient: HereRelay) -> None:
    """A question on its way is over as soon as the connection is."""
    user, flight = User(patient), Flight()
    work = stand_in(patient)

    def leave() -> None:
        user.came.acquire()
        user.connection.detach()

    threading.Thread(target=leave).start()
    with pytest.raises(ModelError, match="has left"):
        work.process(1, flight)


def test_a_new_connection_takes_over(patient: HereRelay) -> None:
    """The old one is asked no more, its answers count for nothing, and its end ends nothing."""
    old, flight = User(patient), Flight()
    work = stand_in(patient)
    waiting: list[str] = []

    def ask() -> None:
        with contextlib.suppress(ModelError):
            waiting.append(str(work.process(1, flight)))

    asking = threading.Thread(target=ask)
    asking.start()
    old.came.acquire()
    new = User(patient)
    asking.join(10.0)
    assert not asking.is_alive()
    assert waiting == []
    old.answer(0, item="late")
    old.connection.detach()
    new.say = lambda _: {"item": "new"}
    assert work.process(2, flight) == "new"
    assert len(old.asked) == 1


def test_an_answer_of_another_connection_is_no_answer(patient: HereRelay) -> None:
    """Even with the right number."""
    old = User(patient)
    new, flight = User(patient), Flight()
    work = stand_in(patient)

    def answer() -> None:
        new.came.acquire()
        old.connection.answered({"number": new.asked[0][0]["number"], "item": "forged"})
        new.answer(0, item="true")

    threading.Thread(target=answer).start()
    assert work.process(1, flight) == "true"


@pytest.mark.parametrize(
    ("answer", "blob", "said"),
    [
        ({"item": "x" * LARGEST_ANSWER}, b"", "the most are 1048576"),
        ({"item": None}, b"more", "4 beside it"),
        ({"item": {"is": "Waypoint", "of": {"id": 5}}}, b"", "Waypoint.id: Input should"),
        ({"item": {"is": "os.system"}}, b"", "no class 'os.system'"),
        ({"item": "a text"}, b"", "declares AeroNavigation and sent str"),
        ({"item": item_json(OpaqueItem("AeroNavigation", 1))}, b"",
         "and sent AeroNavigation of the application's own, or one that holds an object of"),
        ({"item": {"is": "Readings", "of": {"stamp": 1, "values": {}}}}, b"",
         "declares AeroNavigation and sent Readings"),
        ({"failed": "ValueError: boo"}, b"", "the user's side: ValueError: boo"),
        ({"item": {1, 2}}, b"", "no JSON"),
    ],
)  # fmt: skip
def test_a_wrong_answer_is_an_error_of_the_analysis(
    patient: HereRelay, answer: dict[str, Any], blob: bytes, said: str
) -> None:
    """One that is told, with the next item processed as ever."""
    user, flight = User(patient), Flight()
    work = stand_in(patient, AeroNavigation)

    def reply() -> None:
        user.came.acquire()
        number = user.asked[0][0]["number"]
        user.connection.answered({**answer, "number": number}, blob)

    threading.Thread(target=reply).start()
    with pytest.raises((ModelError, MessageError), match=said):
        work.process(1, flight)
    user.say = lambda _: {"item": None}
    assert work.process(2, flight) is None


@pytest.mark.parametrize("answer", [None, 5, [], {}, {"number": "1"}, {"number": -1}])
def test_what_answers_nothing_is_ignored(relay: HereRelay, answer: object) -> None:
    """It raises nothing in the connection's thread."""
    User(relay).connection.answered(answer, b"x")


def test_a_full_queue_is_a_missing_user(relay: HereRelay) -> None:
    """What `send` raises is told."""

    def full(_: dict[str, Any], __: bytes) -> None:
        raise BufferError("100 questions wait already")

    relay.attach(full)
    with pytest.raises(ModelError, match="takes nothing: 100 questions wait"):
        stand_in(relay).process(1, Flight())


def test_conditions_say_which_were_met(patient: HereRelay) -> None:
    """Of an analysis that runs elsewhere; with none of them met there is no result."""
    user, flight = User(patient), Flight()
    user.say = lambda asked: {"fired": [1] if asked["item"] > 2 else []}
    work = HereConditions("drone/a", HereSite(patient.path))
    work.open()
    assert work.process(1, flight) is None
    found = work.process(3, flight)
    assert found == Readings(7, {"met": 1})
    assert [AnsweredCondition("drone/a", number)(found) for number in (0, 1)] == [0, 1]
    assert user.asked[0][0]["do"] == "met"


def test_a_stand_in_without_its_relay_cannot_open(tmp_path: Path) -> None:
    """On another machine than the flight's process, say."""
    with pytest.raises(ModelError, match=r"not to be reached from here"):
        HereAnalysis("drone/a", HereSite(tmp_path / "none.sock")).open()


def test_a_lost_relay_is_told_once(patient: HereRelay) -> None:
    """The end of the flight's process is that of its drones' own link, which acts on it."""
    user, flight = User(patient), Flight()
    user.say = echo
    work = stand_in(patient)
    assert work.process(1, flight) == 1
    patient.close()
    with pytest.raises(ModelError, match="relay"):
        work.process(2, flight)
    assert work.process(3, flight) is None
    work.close()


def test_only_the_flights_own_user_reaches_the_socket(patient: HereRelay, tmp_path: Path) -> None:
    """And there is none where there can be none."""
    assert os.stat(patient.path).st_mode & 0o077 == 0  # noqa: PTH116 - of a socket
    with pytest.raises(ConfigError, match="no socket at"):
        HereRelay(tmp_path / "missing" / "here.sock").start()

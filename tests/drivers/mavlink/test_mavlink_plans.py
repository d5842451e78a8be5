"""Plans item by item, against an autopilot whose every word is written down, in no real time."""

from __future__ import annotations

import contextlib
import queue
from collections import deque
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from aerodaas.config.model import GeofenceConfig
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices import fence, plans
from aerodaas.drivers.mavlink.microservices.fence import upload_fence
from aerodaas.drivers.mavlink.microservices.plans import MissionItem, download, upload
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import VehicleError
from aerodaas.types.geometry import GeodeticOrigin

MISSION = mavlink.MAV_MISSION_TYPE_MISSION
FENCE = mavlink.MAV_MISSION_TYPE_FENCE
RALLY = mavlink.MAV_MISSION_TYPE_RALLY
ITEMS = [
    MissionItem(16, (1.0, 2.0, 3.0, 4.0), 473977420 + index, -85455940 - index, 10.5 + index)
    for index in range(3)
]


class Autopilot:
    """The other end of a link: answers each word as it is told to; waiting moves its clock."""

    target = (7, 1)

    def __init__(self, answer: Callable[[Any], list[Any]] = lambda _: []) -> None:
        self.now = 100.0
        self.sent: list[Any] = []
        self.at: list[float] = []
        """When each of them was sent."""
        self.names: tuple[str, ...] = ()
        """What it listens for."""
        self._answer = answer
        self._inbox: deque[Any] = deque()

    @contextlib.contextmanager
    def listen(self, *names: str) -> Iterator[Autopilot]:
        """Its answers."""
        self.names = names
        yield self

    def get(self, timeout: float) -> Any:  # noqa: ANN401 - pymavlink has no types
        """The next of them, after a hundredth of a second; or silence."""
        if not self._inbox:
            self.now += timeout
            raise queue.Empty
        self.now += 0.01
        return self._inbox.popleft()

    def send(self, message: Any) -> None:  # noqa: ANN401 - the same
        """Hear one word."""
        self.sent.append(message)
        self.at.append(self.now)
        self._inbox += [one for one in self._answer(message) if one.get_type() in self.names]

    def kinds(self) -> list[str]:
        """What was said to it."""
        return [message.get_type() for message in self.sent]


@pytest.fixture
def meet(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """An autopilot with a way to answer, whose clock is the driver's."""

    def made(answer: Callable[[Any], list[Any]] = lambda _: []) -> Autopilot:
        autopilot = Autopilot(answer)
        monkeypatch.setattr(plans, "time", SimpleNamespace(monotonic=lambda: autopilot.now))
        return autopilot

    return made


def ack(result: int = 0, kind: int = MISSION) -> Any:  # noqa: ANN401
    """The word that it has everything, or why not."""
    return mavlink.MAVLink_mission_ack_message(245, 191, result, kind)


def wants(index: int, kind: int = MISSION) -> Any:  # noqa: ANN401
    """It asks for an item."""
    return mavlink.MAVLink_mission_request_int_message(245, 191, index, kind)


def taking(count: int, kind: int = MISSION) -> Callable[[Any], list[Any]]:
    """It asks for one item after the other, and has them all then."""

    def answer(message: Any) -> list[Any]:  # noqa: ANN401
        following = message.seq + 1 if message.get_type() == "MISSION_ITEM_INT" else 0
        return [wants(following, kind) if following < count else ack(kind=kind)]

    return answer


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_an_upload_word_by_word(meet: Callable[..., Any], kind: int) -> None:
    """The count, then each item whole; a mission's first is its present one, a fence has none."""
    autopilot, seen = meet(taking(3, kind)), []
    upload(autopilot, ITEMS, kind, lambda done, total: seen.append((done, total)))
    assert seen == [(0, 3), (1, 3), (2, 3), (3, 3)]
    count, *items = autopilot.sent
    assert count.get_type() == "MISSION_COUNT"
    assert (count.target_system, count.target_component) == (7, 1)
    assert (count.count, count.mission_type) == (3, kind)
    assert [item.seq for item in items] == [0, 1, 2]
    assert [item.current for item in items] == [int(kind == MISSION), 0, 0]
    for said, item in zip(items, ITEMS, strict=True):
        assert (said.target_system, said.target_component) == (7, 1)
        assert (said.frame, said.command) == (item.frame, item.command)
        assert item.frame == mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        assert (said.param1, said.param2, said.param3, said.param4) == item.values
        assert (said.x, said.y, said.z) == (item.x, item.y, item.z)
        assert (said.autocontinue, said.mission_type) == (1, kind)


def test_a_mission_without_items_is_an_upload_too() -> None:
    """It clears what the vehicle holds; without anybody who wants to know how far it is."""
    autopilot = Autopilot(taking(0))
    upload(autopilot, [])  # type: ignore[arg-type]
    (count,) = autopilot.sent
    assert (count.count, count.mission_type) == (0, MISSION)


def test_an_old_autopilot_asks_in_the_old_way(meet: Callable[..., Any]) -> None:
    """By MISSION_REQUEST: it is answered all the same."""

    def old(message: Any) -> list[Any]:  # noqa: ANN401
        if message.get_type() == "MISSION_COUNT":
            return [mavlink.MAVLink_mission_request_message(245, 191, 0, MISSION)]
        return [ack()]

    autopilot = meet(old)
    upload(autopilot, ITEMS[:1])
    assert autopilot.kinds() == ["MISSION_COUNT", "MISSION_ITEM_INT"]


@pytest.mark.parametrize(
    ("result", "why"),
    [
        (mavlink.MAV_MISSION_UNSUPPORTED_FRAME, "it does not know this frame"),
        (mavlink.MAV_MISSION_UNSUPPORTED, "it does not know this command"),
        (mavlink.MAV_MISSION_NO_SPACE, "it has no room for so many"),
        (mavlink.MAV_MISSION_INVALID, "an item holds a wrong value"),
        (mavlink.MAV_MISSION_INVALID_SEQUENCE, "items came out of order"),
        (mavlink.MAV_MISSION_DENIED, "it is denied at present"),
        (mavlink.MAV_MISSION_OPERATION_CANCELLED, "it was cancelled"),
        (mavlink.MAV_MISSION_ERROR, "result 1"),
    ],
)
def test_why_a_plan_was_refused(meet: Callable[..., Any], result: int, why: str) -> None:
    """At once, in words."""
    autopilot = meet(lambda _: [ack(result, FENCE)])
    with pytest.raises(VehicleError, match=f"the autopilot refused the fence: {why}"):
        upload(autopilot, ITEMS, FENCE)
    assert len(autopilot.sent) == 1


@pytest.mark.parametrize(
    ("kind", "name"),
    [(MISSION, "mission"), (FENCE, "fence"), (RALLY, "rally points"), (9, "plan of type 9")],
)
def test_nobody_takes_the_plan(meet: Callable[..., Any], kind: int, name: str) -> None:
    """Five times the count, a second and a half each."""
    autopilot = meet()
    with pytest.raises(VehicleError, match=f"stopped answering while taking the {name}$"):
        upload(autopilot, ITEMS, kind)
    assert autopilot.kinds() == ["MISSION_COUNT"] * 5
    assert autopilot.at == pytest.approx([100.0, 101.5, 103.0, 104.5, 106.0])
    assert autopilot.now == pytest.approx(107.5)


def test_an_item_that_gets_lost_is_said_again(meet: Callable[..., Any]) -> None:
    """Five times more, a second each, for in a transfer it is waited less; then it is given up."""
    autopilot = meet(lambda message: [wants(0)] if message.get_type() == "MISSION_COUNT" else [])
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert autopilot.kinds() == ["MISSION_COUNT"] + ["MISSION_ITEM_INT"] * 6
    waits = [after - before for before, after in zip(autopilot.at, autopilot.at[1:], strict=False)]
    assert waits == pytest.approx([0.01, 1.0, 1.0, 1.0, 1.0, 1.0])


def test_a_transfer_begins_anew_only_once_all_was_sent(meet: Callable[..., Any]) -> None:
    """Asked for the second of three and never more, it says that one again.

    Asked for the last, and for one before it then, it begins anew: all was there once.
    """

    def stuck(message: Any) -> list[Any]:  # noqa: ANN401
        following = {"MISSION_COUNT": 0, "MISSION_ITEM_INT": 1}[message.get_type()]
        return [wants(following)] if not following or message.seq == 0 else []

    autopilot = meet(stuck)
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert [one.seq for one in autopilot.sent[1:]] == [0] + [1] * 6
    backwards = meet(
        lambda message: [wants(2), wants(0)] if message.get_type() == "MISSION_COUNT" else []
    )
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(backwards, ITEMS)
    assert backwards.kinds() == (["MISSION_COUNT"] + ["MISSION_ITEM_INT"] * 2) * 5


def test_a_transfer_that_is_never_acknowledged_is_begun_five_times(
    meet: Callable[..., Any],
) -> None:
    """Each with all its items; who has them all is not sent the last of them again."""

    def forgetful(message: Any) -> list[Any]:  # noqa: ANN401
        return [one for one in taking(3)(message) if one.get_type() != "MISSION_ACK"]

    autopilot = meet(forgetful)
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert autopilot.kinds() == (["MISSION_COUNT"] + ["MISSION_ITEM_INT"] * 3) * 5


def test_what_does_not_belong_to_the_transfer_is_passed_over(meet: Callable[..., Any]) -> None:
    """Another kind of plan's words, and an item that there is not: the fourth of three."""

    def confused(message: Any) -> list[Any]:  # noqa: ANN401
        foreign = [ack(mavlink.MAV_MISSION_DENIED, RALLY), wants(1, RALLY), wants(3)]
        return [*foreign, *taking(3)(message)]

    autopilot = meet(confused)
    upload(autopilot, ITEMS)
    assert [one.seq for one in autopilot.sent[1:]] == [0, 1, 2]


def test_words_of_others_do_not_make_us_wait_longer(meet: Callable[..., Any]) -> None:
    """200 of them, a hundredth of a second apart, for each of ours: 1.5 s remain 1.5 s."""
    autopilot = meet(lambda _: [ack(kind=RALLY)] * 200)
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert autopilot.at == pytest.approx([100.0, 101.5, 103.0, 104.5, 106.0], abs=0.05)


def holding(items: list[MissionItem], kind: int) -> Callable[[Any], list[Any]]:
    """It has these items and gives them when asked."""

    def answer(message: Any) -> list[Any]:  # noqa: ANN401
        if message.get_type() == "MISSION_REQUEST_LIST":
            return [mavlink.MAVLink_mission_count_message(245, 191, len(items), kind)]
        if message.get_type() != "MISSION_REQUEST_INT":
            return []
        return [given(items[message.seq], message.seq, kind)]

    return answer


def given(item: MissionItem, index: int, kind: int) -> Any:  # noqa: ANN401
    """One of its items on the wire."""
    return mavlink.MAVLink_mission_item_int_message(
        245,
        191,
        index,
        item.frame,
        item.command,
        0,
        1,
        *item.values,
        item.x,
        item.y,
        item.z,
        kind,
    )


@pytest.mark.parametrize("kind", [MISSION, FENCE])
def test_a_download_word_by_word(meet: Callable[..., Any], kind: int) -> None:
    """The list, each item, and thanks; to the vehicle, and of this kind of plan throughout."""
    held = [*ITEMS, MissionItem(5001, (3.0, 0.0, 0.0, 0.0), -1, 2, 0.0, mavlink.MAV_FRAME_GLOBAL)]
    autopilot, seen = meet(holding(held, kind)), []
    got = download(autopilot, kind, lambda done, total: seen.append((done, total)))
    assert got == held
    assert seen == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert autopilot.kinds() == [
        "MISSION_REQUEST_LIST",
        *["MISSION_REQUEST_INT"] * 4,
        "MISSION_ACK",
    ]
    assert {(one.target_system, one.target_component) for one in autopilot.sent} == {(7, 1)}
    assert {one.mission_type for one in autopilot.sent} == {kind}
    assert [one.seq for one in autopilot.sent[1:5]] == [0, 1, 2, 3]
    assert autopilot.sent[-1].type == mavlink.MAV_MISSION_ACCEPTED


def test_a_vehicle_without_a_mission(meet: Callable[..., Any]) -> None:
    """No items, and thanks all the same."""
    autopilot = meet(holding([], MISSION))
    assert download(autopilot) == []
    assert autopilot.kinds() == ["MISSION_REQUEST_LIST", "MISSION_ACK"]


@pytest.mark.parametrize("total", [2000, 2001])
def test_more_than_two_thousand_items_are_not_believed(
    meet: Callable[..., Any], total: int
) -> None:
    """A count of a damaged packet would have us ask for hours."""
    autopilot = meet(holding(ITEMS[:1] * total, MISSION))
    if total > 2000:
        with pytest.raises(VehicleError, match="its mission has 2001 items"):
            download(autopilot)
        assert len(autopilot.sent) == 1
    else:
        assert len(download(autopilot)) == 2000


def test_answers_to_what_was_asked_before_are_passed_over(meet: Callable[..., Any]) -> None:
    """A count while an item is awaited, the item before, an item while the count is awaited."""
    items = holding(ITEMS, MISSION)

    def late(message: Any) -> list[Any]:  # noqa: ANN401
        count = mavlink.MAVLink_mission_count_message(245, 191, 9, MISSION)
        if message.get_type() == "MISSION_REQUEST_LIST":
            return [given(ITEMS[2], 0, MISSION), *items(message)]
        before = [given(ITEMS[2], index, MISSION) for index in (message.seq - 1, message.seq + 1)]
        return [count, *[one for one in before if one.seq >= 0], *items(message)]

    autopilot = meet(lambda said: late(said) if "REQUEST" in said.get_type() else [])
    assert download(autopilot) == ITEMS
    assert len(autopilot.sent) == 5


def test_what_is_asked_in_vain_is_asked_five_times(meet: Callable[..., Any]) -> None:
    """For the list and for an item alike, a second and a half each; lost once is no harm."""
    autopilot = meet()
    with pytest.raises(VehicleError, match="does not answer when asked for its rally points"):
        download(autopilot, RALLY)
    assert autopilot.at == pytest.approx([100.0, 101.5, 103.0, 104.5, 106.0])
    heard = {"MISSION_REQUEST_LIST": 0, "MISSION_REQUEST_INT": 0, "MISSION_ACK": 0}

    def lossy(message: Any) -> list[Any]:  # noqa: ANN401
        heard[message.get_type()] += 1
        lost = heard[message.get_type()] % 5
        return [] if lost else holding(ITEMS, MISSION)(message)

    assert download(meet(lossy)) == ITEMS
    assert heard == {"MISSION_REQUEST_LIST": 5, "MISSION_REQUEST_INT": 15, "MISSION_ACK": 1}


def test_an_uploaded_fence_comes_with_what_enforces_it(
    meet: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The corners as a fence, then the parameters of its action and its ceiling."""
    autopilot, log, seen = meet(taking(3, FENCE)), [], []

    class Noted:
        def __init__(self, *of: object) -> None:
            self._of = of

        def set(self, name: str, value: float) -> None:
            log.append((self._of, name, value, len(autopilot.sent)))

    monkeypatch.setattr(fence, "Parameters", Noted)
    drawn, px4 = GeofenceConfig(polygon=[(0, 0), (9, 0), (0, 9)], ceiling=40.0), PX4()
    home = GeodeticOrigin(47.0, 8.0)
    upload_fence(
        autopilot,
        px4,
        drawn,
        home,
        "return",
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen[-1] == (3, 3)
    of = (autopilot, px4)
    assert log == [(of, "GF_ACTION", 3.0, 4), (of, "GF_MAX_VER_DIST", 40.0, 4)]
    upload_fence(autopilot, px4, drawn, home, "land")
    assert log[2][1:3] == ("GF_ACTION", 5.0)

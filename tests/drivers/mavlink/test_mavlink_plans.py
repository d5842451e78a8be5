"""Plans item by item, against a scripted autopilot, in no real time."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise
from typing import Any, TypeAlias

import pytest
from autopilot import Answer, ScriptedAutopilot
from emulated import Flight

from aerodaas.config.model import GeofenceConfig
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.microservices.fence import fence_items, upload_fence
from aerodaas.drivers.mavlink.microservices.plans import MissionItem, upload
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.errors import VehicleError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.testing.channel import Impairment
from tools.mavlink_vehicle import AutopilotOptions

MISSION = mavlink.MAV_MISSION_TYPE_MISSION
FENCE = mavlink.MAV_MISSION_TYPE_FENCE
RALLY = mavlink.MAV_MISSION_TYPE_RALLY
COUNT, ITEM = "MISSION_COUNT", "MISSION_ITEM_INT"
ITEMS = [
    MissionItem(16, (1.0, 2.0, 3.0, 4.0), 473977420 + index, -85455940 - index, 10.5 + index)
    for index in range(3)
]
HOME = GeodeticOrigin(47.0, 8.0)
Meet: TypeAlias = Callable[..., Any]


@pytest.fixture
def meet(monkeypatch: pytest.MonkeyPatch) -> Meet:
    """Makes an autopilot with one answer to all of these messages, whose clock is the driver's."""

    def made(answer: Answer = lambda _: [], *names: str) -> ScriptedAutopilot:
        autopilot = ScriptedAutopilot(answers=dict.fromkeys(names or (COUNT, ITEM), answer))
        autopilot.clock.drive(monkeypatch)
        return autopilot

    return made


def ack(result: int = 0, kind: int = MISSION) -> Any:  # noqa: ANN401 - pymavlink has no types
    """The word that it has everything, or why not."""
    return mavlink.MAVLink_mission_ack_message(245, 191, result, kind)


def wants(index: int, kind: int = MISSION) -> Any:  # noqa: ANN401
    """It asks for an item."""
    return mavlink.MAVLink_mission_request_int_message(245, 191, index, kind)


def taking(count: int, kind: int = MISSION) -> Answer:
    """It asks for one item after the other, and has them all then."""

    def answer(message: Any) -> list[Any]:  # noqa: ANN401
        following = message.seq + 1 if message.get_type() == ITEM else 0
        return [wants(following, kind) if following < count else ack(kind=kind)]

    return answer


def times(autopilot: ScriptedAutopilot) -> list[float]:
    """When each message was sent, from the first one on."""
    began = autopilot.received[0][0]
    return [at - began for at, _ in autopilot.received]


@pytest.mark.parametrize("kind", [MISSION, FENCE, RALLY])
def test_an_upload_word_by_word(meet: Meet, kind: int) -> None:
    """The count, then each item whole; a mission's first is its present one, a fence has none."""
    autopilot = meet(taking(3, kind))
    upload(autopilot, ITEMS, kind)
    (count,), items = autopilot.of(COUNT), autopilot.of(ITEM)
    assert (count.count, count.mission_type) == (3, kind)
    assert [item.seq for item in items] == [0, 1, 2]
    assert [item.current for item in items] == [int(kind == MISSION), 0, 0]
    for said, item in zip(items, ITEMS, strict=True):
        assert (said.target_system, said.target_component) == (1, 1)
        assert (said.frame, said.command) == (item.frame, item.command)
        assert (said.param1, said.param2, said.param3, said.param4) == item.values
        assert (said.x, said.y, said.z, said.mission_type) == (item.x, item.y, item.z, kind)


def test_an_old_autopilot_asks_in_the_old_way(meet: Meet) -> None:
    """By MISSION_REQUEST: it is answered all the same."""

    def old(message: Any) -> list[Any]:  # noqa: ANN401
        if message.get_type() == COUNT:
            return [mavlink.MAVLink_mission_request_message(245, 191, 0, MISSION)]
        return [ack()]

    autopilot = meet(old)
    upload(autopilot, ITEMS[:1])
    assert autopilot.kinds() == [COUNT, ITEM]


@pytest.mark.parametrize(
    ("result", "why"),
    [
        (mavlink.MAV_MISSION_UNSUPPORTED, "it does not know this command"),
        (mavlink.MAV_MISSION_NO_SPACE, "it has no room for so many"),
        (mavlink.MAV_MISSION_ERROR, "result 1"),
    ],
)
def test_why_a_plan_was_refused(meet: Meet, result: int, why: str) -> None:
    """At once, in words."""
    autopilot = meet(lambda _: [ack(result, FENCE)])
    with pytest.raises(VehicleError, match=f"the autopilot refused the fence: {why}"):
        upload(autopilot, ITEMS, FENCE)
    assert len(autopilot.received) == 1


def test_nobody_takes_the_plan(meet: Meet) -> None:
    """Five times the count, a second and a half each; words of others do not make us wait more."""
    for answer in (lambda _: [], lambda _: [ack(kind=RALLY)] * 200):
        autopilot = meet(answer)
        with pytest.raises(VehicleError, match=r"taking the mission$"):
            upload(autopilot, ITEMS)
        assert autopilot.kinds() == [COUNT] * 5
        assert times(autopilot) == pytest.approx([0.0, 1.5, 3.0, 4.5, 6.0], abs=0.05)


def test_an_item_that_gets_lost_is_said_again(meet: Meet) -> None:
    """Five times more, a second each, for in a transfer it is waited less; then it is given up."""
    autopilot = meet(lambda _: [wants(0)], COUNT)
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert autopilot.kinds() == [COUNT] + [ITEM] * 6
    at = times(autopilot)
    waits = [after - before for before, after in pairwise(at)]
    assert waits == pytest.approx([0.01, 1.0, 1.0, 1.0, 1.0, 1.0])


def test_tries_of_an_upload_begin_anew_with_each_answer(meet: Meet) -> None:
    """Five in vain end it, but in a row: a long plan over a bad link gets through."""
    heard = [0]

    def tired(message: Any) -> Iterable[Any]:  # noqa: ANN401
        heard[0] += 1
        last = message.get_type() == ITEM and message.seq == 7
        return taking(8)(message) if last or heard[0] % 4 == 0 else []

    autopilot = meet(tired)
    upload(autopilot, [ITEMS[0]] * 8)
    assert autopilot.of(ITEM)[-1].seq == 7


def test_a_transfer_that_is_never_acknowledged_is_begun_five_times(meet: Meet) -> None:
    """Each with all its items; who has them all is not sent the last of them again."""

    def forgetful(message: Any) -> list[Any]:  # noqa: ANN401
        return [one for one in taking(3)(message) if one.get_type() != "MISSION_ACK"]

    autopilot = meet(forgetful)
    with pytest.raises(VehicleError, match="stopped answering"):
        upload(autopilot, ITEMS)
    assert autopilot.kinds() == ([COUNT] + [ITEM] * 3) * 5


def test_what_does_not_belong_to_the_transfer_is_passed_over(meet: Meet) -> None:
    """Another kind of plan's words, and an item that there is not: the fourth of three."""

    def confused(message: Any) -> list[Any]:  # noqa: ANN401
        foreign = [ack(mavlink.MAV_MISSION_DENIED, RALLY), wants(1, RALLY), wants(3)]
        return [*foreign, *taking(3)(message)]

    autopilot = meet(confused)
    upload(autopilot, ITEMS)
    assert [one.seq for one in autopilot.of(ITEM)] == [0, 1, 2]


def test_missions_go_up(flight: Flight) -> None:
    """Over a bad link to an emulated autopilot, item by item."""
    bad = Impairment(loss=0.1, duplicates=0.2)
    with flight(AutopilotOptions(uplink=bad, downlink=bad, seed=3)) as ends:
        items = [
            MissionItem(16, (0.0, 0.0, 0.0, 0.0), 473977420 + i, 85455940, 10.0) for i in range(12)
        ]
        upload(ends.vehicle.connection.link, items)
        held = ends.firmware.plans.plans[MISSION]
        assert [(one.command, one.x, one.y, one.z) for one in held] == [
            (one.command, one.x, one.y, one.z) for one in items
        ]


def test_an_uploaded_fence_comes_with_what_enforces_it(meet: Meet) -> None:
    """The corners as a fence, then the parameters of its action and its ceiling."""
    autopilot, px4 = meet(taking(3, FENCE)), PX4()
    kinds = {"GF_ACTION": mavlink.MAV_PARAM_TYPE_INT32}
    held = {"GF_ACTION": px4.encode(1.0, kinds["GF_ACTION"]), "GF_MAX_VER_DIST": 0.0}

    def told(message: Any) -> list[Any]:  # noqa: ANN401
        name = message.param_id
        held[name] = getattr(message, "param_value", held[name])
        kind = kinds.get(name, mavlink.MAV_PARAM_TYPE_REAL32)
        return [mavlink.MAVLink_param_value_message(name.encode(), held[name], kind, 2, 0)]

    autopilot.answers |= {"PARAM_REQUEST_READ": told, "PARAM_SET": told}
    drawn = GeofenceConfig(polygon=[(0, 0), (9, 0), (0, 9)], ceiling=40.0)
    for action, number in (("return", 3.0), ("land", 5.0)):
        upload_fence(autopilot, px4, drawn, HOME, action)  # type: ignore[arg-type]
        assert px4.decode(held["GF_ACTION"], kinds["GF_ACTION"]) == number
        assert held["GF_MAX_VER_DIST"] == 40.0
    assert [one.mission_type for one in autopilot.of(ITEM)] == [FENCE] * 6


def test_a_fences_corners_are_degrees_times_ten_million() -> None:
    """East is longitude (y), north is latitude (x): 76.1 m and 111.2 m to 0.001 degrees."""
    fence = GeofenceConfig(
        polygon=[(0, 0), (76.1, 0), (76.1, 111.2)], no_fly=[[(0, 0), (-7.61, 0), (0, -11.12)]]
    )
    items = fence_items(fence, HOME)
    inside = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION
    outside = mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION
    assert [item.command for item in items] == [inside] * 3 + [outside] * 3
    assert [item.x for item in items] == pytest.approx(
        [470000000, 470000000, 470010000, 470000000, 470000000, 469999000], abs=15
    )
    assert [item.y for item in items] == pytest.approx(
        [80000000, 80010000, 80010000, 80000000, 79999000, 80000000], abs=15
    )
    assert {item.values for item in items} == {(3.0, 0.0, 0.0, 0.0)}
    assert fence_items(GeofenceConfig(), HOME) == []

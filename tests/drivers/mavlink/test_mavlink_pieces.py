"""The parts of the driver alone: frames, phases, commands, guidance, plans."""

from __future__ import annotations

import contextlib
import math
import queue
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from emulated import Flight
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from aerodaas.config.model import GeofenceConfig, RobotConfig
from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.control.guidance import MovingTarget
from aerodaas.drivers.mavlink.control.steering import Steering
from aerodaas.drivers.mavlink.microservices import plans
from aerodaas.drivers.mavlink.microservices.commander import (
    Commander,
    CommandResult,
    PendingCommand,
)
from aerodaas.drivers.mavlink.microservices.fence import fence_items
from aerodaas.drivers.mavlink.microservices.plans import MissionItem
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.frames import LocalFrame, attitude_from_frd
from aerodaas.drivers.mavlink.state.phase import FlightMode, FlightPhase
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.data import Odometry
from aerodaas.types.geometry import GeodeticOrigin
from aerodaas.types.vehicle import PositionSetpoint, VehicleMode
from tools.mavlink_vehicle import AutopilotOptions, Impairment
from tools.mavlink_vehicle.store import PlanStore

metre = st.floats(-1e4, 1e4)
place = st.tuples(metre, metre, metre).map(np.array)


@given(place, place, place)
def test_places_go_there_and_back(start: Any, ned: Any, enu: Any) -> None:  # noqa: ANN401
    """Pinned where it stands, and each way undoes the other."""
    frame = LocalFrame.standing_at(start, ned)
    assert frame.position(ned) == pytest.approx(start)
    assert frame.position(frame.place(enu)) == pytest.approx(enu, abs=1e-6)


def test_directions() -> None:
    """North is y, down is minus z, clockwise is minus, nose up is minus."""
    frame = LocalFrame.standing_at(np.zeros(3), np.zeros(3))
    assert frame.position(np.array([1.0, 2.0, 3.0])) == pytest.approx([2.0, 1.0, -3.0])
    attitude = attitude_from_frd(0.1, 0.2, 0.0, 0.3)
    assert attitude.yaw == pytest.approx(math.pi / 2)
    assert (attitude.roll, attitude.pitch, attitude.yaw_rate) == (0.1, -0.2, -0.3)


@given(
    place.map(lambda one: one / 100),
    st.floats(0.2, 10),
    st.lists(st.floats(0.0, 0.5), min_size=5, max_size=60),
)
def test_the_moving_target_keeps_to_its_speed(goal: Any, speed: float, waits: list[float]) -> None:  # noqa: ANN401
    """It never moves faster than asked, never runs far ahead, and never overshoots."""
    target = MovingTarget(3.0, 1.5)
    here, now = np.zeros(3), 100.0
    before: Any = None
    for wait in waits:
        now += wait
        seen = target.towards(
            PositionSetpoint(goal),
            speed,
            vehicle=here,
            velocity=np.zeros(3),
            facing=0.0,
            now=now,
        )
        if before is not None:
            moved = float(np.linalg.norm(seen.position - before))
            assert moved <= speed * min(wait, 0.2) + 1e-6
        assert float(np.linalg.norm(seen.position)) <= 1.0 + 1.2 * speed + 1e-6
        assert np.linalg.norm(seen.position) <= np.linalg.norm(goal) + 1e-6
        before = seen.position


def flown_by_lag(goal: float, speed: float, lag: float) -> NDArray[np.float64]:
    """Place and speed of an autopilot on a straight way, one row each 10 ms.

    It adds what draws it to the target to the velocity that it was sent, as PX4 does, takes that
    up after `lag` seconds, and hears of the target a tenth of a second late.
    """
    target = MovingTarget(3.0, 1.5)
    here = moving = 0.0
    sent: list[tuple[float, float]] = []
    track = []
    for turn in range(round(20 * (goal / speed + 15))):
        seen = target.towards(
            PositionSetpoint(np.array([goal, 0.0, 0.0])),
            speed,
            vehicle=np.array([here, 0.0, 0.0]),
            velocity=np.array([moving, 0.0, 0.0]),
            facing=0.0,
            now=100.0 + turn / 20,
        )
        sent.append((float(seen.position[0]), float(seen.velocity[0])))
        place, velocity = sent[max(0, turn - 2)]
        for _ in range(5):
            wanted = velocity + 0.95 * (place - here)
            moving += 0.01 * max(-3.0, min(3.0, (wanted - moving) / lag))
            here += 0.01 * moving
            track.append((here, moving))
    return np.array(track)


@given(st.floats(2.0, 15.0), st.floats(0.5, 3.0), st.floats(0.1, 0.8))
def test_a_vehicle_that_follows_late_is_slow_where_it_arrives(
    goal: float, speed: float, lag: float
) -> None:
    """Never faster than asked, hardly beyond the place, and slow where a landing may follow."""
    track = flown_by_lag(goal, speed, lag)
    assert track[:, 1].max() < 1.05 * speed
    assert track[:, 0].max() < goal + 0.2
    assert track[-1] == pytest.approx([goal, 0.0], abs=0.05)
    near = int(np.argmax(track[:, 0] > goal - 0.3))
    assert track[near, 1] < 0.9


@given(st.floats(2.0, 15.0), st.floats(0.1, 0.8))
def test_a_long_way_is_flown_at_the_speed_asked_for(speed: float, lag: float) -> None:
    """Once fast, the vehicle stays so until it has to brake: its target does not wait for it."""
    ramp, goal = 3.0 * speed + 10.0, 40.0 * speed + 100.0
    track = flown_by_lag(goal, speed, lag)
    on_the_way = (track[:, 0] > ramp) & (track[:, 0] < 0.5 * goal)
    assert track[on_the_way, 1].min() > 0.9 * speed


def flown_along(
    corners: list[tuple[float, float]], speed: float, passing: float, radius: float, lag: float
) -> NDArray[np.float64]:
    """Places and speeds along a path, one row each 10 ms, of an autopilot as in `flown_by_lag`.

    Within `radius` of a corner the next one is its place; the first one is where it begins.
    """
    target, here, moving = MovingTarget(3.0, 1.5), np.array([*corners[0], 0.0]), np.zeros(3)
    places = [np.array([*corner, 0.0]) for corner in corners]
    leg, sent, track = 1, list[Any](), list[tuple[float, ...]]()
    for turn in range(4000):
        if np.linalg.norm(places[leg] - here) <= radius:
            leg += 1
            if leg == len(places):
                break
        last = leg == len(places) - 1
        setpoint = PositionSetpoint(
            places[leg], None, speed, 0.0 if last else passing, places[leg - 1]
        )
        seen = target.towards(
            setpoint, speed, vehicle=here, velocity=moving, facing=0.0, now=100.0 + turn / 20
        )
        sent.append(seen)
        late = sent[max(0, turn - 2)]
        for _ in range(5):
            wanted = late.velocity + 0.95 * (late.position - here)
            change = (wanted - moving) / lag
            moving = moving + 0.01 * change * min(
                1.0, 3.0 / max(1e-9, float(np.linalg.norm(change)))
            )
            here = here + 0.01 * moving
            track.append((*here[:2], float(np.linalg.norm(moving))))
    return np.array(track)


@given(st.floats(2.0, 12.0), st.floats(0.1, 0.8), st.floats(0.3, 3.0))
def test_a_corner_of_a_path_leads_onto_the_next_line(
    speed: float, lag: float, radius: float
) -> None:
    """A target that turned early comes onto the line, and the vehicle after it."""
    far = 15.0 * speed
    track = flown_along([(0, 0), (far, 0), (far, far)], speed, 0.0, radius, lag)
    after = track[track[:, 1] > far / 3]
    assert len(after) > 0
    assert np.abs(after[:, 0] - far).max() < 0.15
    assert track[:, 0].max() < far + 1.0
    assert track[-1] == pytest.approx([far, far, 0.0], abs=radius + 1.5)


@given(st.floats(2.0, 12.0), st.floats(0.1, 0.8), st.floats(0.2, 1.0))
def test_a_place_is_passed_at_the_speed_asked_for(speed: float, lag: float, share: float) -> None:
    """Neither a stop nor a burst, and at the end of the path it stops."""
    far, passing = 15.0 * speed, share * speed
    track = flown_along([(0, 0), (far, 0), (2 * far, 0)], speed, passing, 0.5, lag)
    there = track[int(np.argmax(track[:, 0] > far - 0.5)), 2]
    assert 0.75 * passing - 0.2 < there < passing + 1.2
    assert track[:, 2].max() < 1.1 * speed
    assert track[:, 0].max() < 2 * far + 0.3


def test_a_vehicle_at_its_limit_is_asked_for_little_more_than_it_does() -> None:
    """Against the wind it flies at 6 m/s, whatever it is told."""
    target, here, moving = MovingTarget(3.0, 1.5), np.zeros(3), np.array([6.0, 0.0, 0.0])
    far = PositionSetpoint(np.array([900.0, 0.0, 0.0]))
    seen = target.towards(far, 10.0, vehicle=here, velocity=moving, facing=0.0, now=100.0)
    for turn in range(1, 400):
        here = here + moving * 0.05
        seen = target.towards(
            far, 10.0, vehicle=here, velocity=moving, facing=0.0, now=100.0 + turn / 20
        )
    assert float(seen.velocity[0]) <= 8.0
    assert 0.5 < float(seen.position[0] - here[0]) < 2.5


def test_a_vehicle_that_was_blown_far_away_is_waited_for() -> None:
    """Its target stands and is not flown on from."""
    target, far = MovingTarget(3.0, 1.5), PositionSetpoint(np.array([900.0, 0.0, 0.0]))
    state: dict[str, Any] = {"velocity": np.zeros(3), "facing": 0.0}
    first = target.towards(far, 5.0, vehicle=np.zeros(3), now=100.0, **state)
    blown = first.position + np.array([0.0, 6.5, 0.0])
    seen = target.towards(far, 5.0, vehicle=blown, now=100.05, **state)
    assert seen.position.tolist() == first.position.tolist()
    assert not seen.velocity.any()


def test_a_setpoint_is_told_as_it_was_clipped() -> None:
    """A place is passed no faster than the way there is flown."""
    robot = RobotConfig.model_validate(
        {"id": "drone", "driver": "mavlink", "settings": {}, "limits": {"max_speed": 4.0}}
    )
    steering = Steering(robot, MavlinkSettings(url="udpin:127.0.0.1:14540"))
    asked = PositionSetpoint(np.array([50.0, 0.0, 5.0]), None, 9.0, 8.0, np.zeros(3))
    frame = LocalFrame.standing_at(np.zeros(3), np.zeros(3))
    here = Odometry(np.zeros(3), np.zeros(3), 0.0)
    _, sent = steering.message(asked, here, frame, (1, 1), 10.0, waits=False)
    assert sent == replace(asked, speed=4.0, passing_speed=4.0)


MODES = list(FlightMode)


@given(
    st.lists(
        st.tuples(
            st.sampled_from([None, *[one for one in MODES if one is not FlightMode.OTHER]]),
            st.sampled_from(MODES),
            st.booleans(),
            st.floats(0.0, 5.0),
        ),
        max_size=40,
    )
)
def test_who_has_taken_over_keeps_it(steps: list[tuple[Any, Any, bool, float]]) -> None:
    """Once taken, a vehicle is ours again only after it has been disarmed, or let rest there."""
    phase, now, taken = FlightPhase(), 0.0, False
    for wish, shown, armed, wait in steps:
        now += wait
        if wish is not None and not taken:
            phase.ask(wish, now)
        phase.observe(shown, now, armed=armed, critical=False)
        if phase.taken is not None and not armed:
            phase.rest()
        taken = armed and (taken or phase.taken is not None)
        assert (phase.taken is not None) == taken
        if taken:
            assert phase.mode is VehicleMode.MANUAL
        if not armed:
            assert phase.mode is VehicleMode.GROUNDED


def test_a_late_heartbeat_is_no_pilot() -> None:
    """HEARTBEATs that still show the mode before are waited for; any other mode is taken."""
    phase = FlightPhase()
    phase.observe(FlightMode.HOLD, 0.0, armed=True, critical=False)
    phase.ask(FlightMode.GUIDED, 1.0)
    phase.observe(FlightMode.HOLD, 2.0, armed=True, critical=False)
    phase.observe(FlightMode.GUIDED, 3.0, armed=True, critical=False)
    assert phase.mode is VehicleMode.GUIDED
    phase.ask(FlightMode.RETURN, 4.0)
    phase.observe(FlightMode.GUIDED, 5.0, armed=True, critical=False)
    assert phase.taken is None
    phase.observe(FlightMode.HOLD, 6.0, armed=True, critical=True)
    assert phase.taken is VehicleMode.FAILSAFE


class Ear:
    """What a commander sends, and what became of its orders."""

    def __init__(self) -> None:
        self.sent: list[Any] = []
        self.outcomes: queue.SimpleQueue[CommandResult] = queue.SimpleQueue()
        self.commander = Commander(self.sent.append, (1, 1), 245)

    def acknowledge(self, number: int, result: int, now: float) -> None:
        """Answer."""
        self.commander.take(
            mavlink.MAVLink_command_ack_message(number, result, 0, 0, 245, 191), now
        )


TAKE_OFF = PendingCommand(mavlink.MAV_CMD_NAV_TAKEOFF, (0.0,) * 7, "take off")


def test_a_lost_order_is_repeated_only_while_it_needs_doing() -> None:
    """A take-off whose acknowledgement got lost is not asked for again once it climbs."""
    ear, climbing = Ear(), [False]
    ear.commander.give(TAKE_OFF, ear.outcomes.put, still=lambda: not climbing[0], now=0.0)
    ear.commander.turn(1.5)
    assert [one.confirmation for one in ear.sent] == [0, 1]
    climbing[0] = True
    ear.commander.turn(3.0)
    assert len(ear.sent) == 2
    assert ear.outcomes.get_nowait().accepted


def test_acknowledgements_twice_late_or_for_others() -> None:
    """One outcome for one order; in progress means waiting longer."""
    ear = Ear()
    ear.commander.give(TAKE_OFF, ear.outcomes.put, now=0.0)
    other = mavlink.MAVLink_command_ack_message(TAKE_OFF.number, 0, 0, 0, 7, 1)
    ear.commander.take(other, 0.1)
    ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_IN_PROGRESS, 0.5)
    ear.commander.turn(3.0)
    assert len(ear.sent) == 1
    ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_ACCEPTED, 4.0)
    ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_DENIED, 4.1)
    assert ear.outcomes.get_nowait().accepted
    assert ear.outcomes.empty()
    assert ear.commander.stray == 1


def test_no_answer_at_all_is_an_outcome() -> None:
    """Six tries, then it is said."""
    ear = Ear()
    ear.commander.give(TAKE_OFF, ear.outcomes.put, now=0.0)
    for second in range(1, 20):
        ear.commander.turn(float(second) * 1.1)
    assert len(ear.sent) == 6
    assert ear.outcomes.get_nowait() == CommandResult(accepted=False, text="no answer", tries=6)


def test_a_replaced_order_ends() -> None:
    """Told once that it was replaced; only the newer one is repeated, and has the answer."""
    ear, newer = Ear(), queue.SimpleQueue[CommandResult]()
    other = PendingCommand(TAKE_OFF.number, (1.0,) * 7, "take off higher")
    ear.commander.give(TAKE_OFF, ear.outcomes.put, now=0.0)
    ear.commander.give(other, newer.put, now=0.5)
    outcome = ear.outcomes.get_nowait()
    assert outcome.replaced
    assert not outcome.accepted
    ear.commander.turn(1.6)
    assert [one.param1 for one in ear.sent] == [0.0, 1.0, 1.0]
    ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_ACCEPTED, 2.0)
    assert newer.get_nowait().accepted
    assert ear.outcomes.empty()


def test_what_is_rejected_for_now_is_asked_again_with_a_bound() -> None:
    """Once a second, and the sixth rejection is the last word; what does not insist has one."""
    ear, now = Ear(), 0.0
    ear.commander.give(TAKE_OFF, ear.outcomes.put, now=now)
    while ear.outcomes.empty():
        ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, now + 0.1)
        now += 0.2
        ear.commander.turn(now)
    assert len(ear.sent) == 6
    assert 5.0 < now < 8.0
    assert ear.outcomes.get_nowait().text == "rejected for now"
    ear.commander.give(PX4.disarm(), ear.outcomes.put, now=now)
    ear.acknowledge(PX4.disarm().number, mavlink.MAV_RESULT_TEMPORARILY_REJECTED, now + 0.1)
    assert not ear.outcomes.get_nowait().accepted


def test_a_withdrawn_order_is_not_repeated() -> None:
    """Nor is anything told of it."""
    ear = Ear()
    ear.commander.give(TAKE_OFF, ear.outcomes.put, now=0.0)
    ear.commander.withdraw(TAKE_OFF.number)
    ear.commander.turn(5.0)
    ear.acknowledge(TAKE_OFF.number, mavlink.MAV_RESULT_ACCEPTED, 5.0)
    assert len(ear.sent) == 1
    assert ear.outcomes.empty()


def test_a_mode_counts_only_once_it_was_seen() -> None:
    """However long a HEARTBEAT takes to show it; after that, the mode before is a pilot's."""
    phase = FlightPhase()
    phase.observe(FlightMode.HOLD, 0.0, armed=True, critical=False)
    phase.ask(FlightMode.GUIDED, 1.0)
    for second in range(2, 30):
        phase.observe(FlightMode.HOLD, float(second), armed=True, critical=False)
        assert not phase.seen
        assert phase.taken is None
    phase.observe(FlightMode.GUIDED, 30.0, armed=True, critical=False)
    assert phase.seen
    phase.observe(FlightMode.HOLD, 31.0, armed=True, critical=False)
    assert phase.taken is VehicleMode.MANUAL
    phase.observe(FlightMode.HOLD, 32.0, armed=False, critical=False)
    phase.ask(FlightMode.GUIDED, 33.0)
    assert not phase.seen


@given(st.integers(-(2**31), 2**31 - 1))
def test_px4s_integers_travel_by_their_bytes(value: int) -> None:
    """Except those whose bytes are no number, which no parameter has."""
    px4, kind = PX4(), mavlink.MAV_PARAM_TYPE_INT32
    encoded = px4.encode(float(value), kind)
    if not math.isnan(encoded):
        assert px4.decode(encoded, kind) == value
    assert ArduPilot().decode(ArduPilot().encode(7.0, kind), kind) == 7.0


def test_missions_go_up_and_come_down(flight: Flight) -> None:
    """Over a bad link, with progress, item by item."""
    bad = Impairment(loss=0.1, duplicates=0.2)
    options = AutopilotOptions(uplink=bad, downlink=bad, seed=3)
    items = [
        MissionItem(
            mavlink.MAV_CMD_NAV_WAYPOINT, (0.0, 0.0, 0.0, 0.0), 473977420 + i, 85455940, 10.0
        )
        for i in range(12)
    ]
    seen: list[tuple[int, int]] = []
    with flight(options) as pair:
        pair.vehicle.upload_mission(items, lambda done, total: seen.append((done, total)))
        assert pair.vehicle.download_mission() == items
    assert seen[-1] == (12, 12)


def test_an_upload_whose_acknowledgement_is_lost_begins_anew(
    flight: Flight,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """An autopilot that has all items answers none of them again."""
    items = [
        MissionItem(
            mavlink.MAV_CMD_NAV_WAYPOINT, (0.0, 0.0, 0.0, 0.0), 473977420 + i, 85455940, 10.0
        )
        for i in range(3)
    ]
    lost: list[Any] = []
    answers = PlanStore.handle

    def forgetful(store: PlanStore, message: Any) -> list[Any]:  # noqa: ANN401 - pymavlink's
        given = answers(store, message)
        if not lost and given and given[0].get_type() == "MISSION_ACK":
            lost.append(given.pop())
        return given

    monkeypatch.setattr(PlanStore, "handle", forgetful)
    with flight(AutopilotOptions()) as pair:
        pair.vehicle.upload_mission(items)
        assert pair.vehicle.download_mission() == items
    assert len(lost) == 1


class Tired:
    """A link to an autopilot that answers each word only the fourth time, and the last at once."""

    target = (1, 1)

    def __init__(self, count: int) -> None:
        self.inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._count = count
        self._heard = 0
        self.next = 0

    @contextlib.contextmanager
    def listen(self, *_: str) -> Iterator[queue.SimpleQueue[Any]]:
        """Its answers."""
        yield self.inbox

    def send(self, message: Any) -> None:  # noqa: ANN401 - pymavlink's
        """Hear one word."""
        self._heard += 1
        item = message.get_type() == "MISSION_ITEM_INT"
        last = item and message.seq == self._count - 1
        if self._heard % 4 and not last:
            return
        self.next += item
        answer = mavlink.MAVLink_mission_request_int_message(245, 191, self.next, 0)
        if last:
            answer = mavlink.MAVLink_mission_ack_message(245, 191, 0, 0)
        self.inbox.put(answer)


def test_tries_of_an_upload_begin_anew_with_each_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Five in vain end it, but in a row: a long plan over a bad link gets through."""
    monkeypatch.setattr(plans, "_TIMEOUT", 0.01)
    monkeypatch.setattr(plans, "_ITEM_TIMEOUT", 0.0025)
    item = MissionItem(mavlink.MAV_CMD_NAV_WAYPOINT, (0.0, 0.0, 0.0, 0.0), 1, 1, 10.0)
    link = Tired(8)
    plans.upload(link, [item] * 8)  # type: ignore[arg-type]
    assert link.next == 8


def test_a_fence_is_drawn_where_it_belongs() -> None:
    """Corners in order, each with their number, no-fly zones as exclusions."""
    fence = GeofenceConfig(
        polygon=[(0, 0), (100, 0), (100, 100)], no_fly=[[(10, 5), (20, 5), (20, 10), (10, 10)]]
    )
    items = fence_items(fence, GeodeticOrigin(47.0, 8.0))
    assert [item.values[0] for item in items] == [3.0] * 3 + [4.0] * 4
    assert (items[0].x, items[0].y) == (470000000, 80000000)
    assert items[1].y > items[0].y
    assert abs(items[1].x - items[0].x) < 100
    assert items[2].x - items[0].x == pytest.approx(100 / 111_150 * 1e7, rel=0.01)

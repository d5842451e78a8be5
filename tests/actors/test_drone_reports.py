"""What a drone's actor says of its robots while its loop flies them and commands come in."""

from __future__ import annotations

import itertools
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from drone_by_hand import DroneByHand, drone_by_hand, spec_by_hand
from flying import hop, robot

from aerodaas import AeroNavigation, NavigationType, Waypoint
from aerodaas.actors.drone.change_signal import ChangeSignal
from aerodaas.config.model import EnvironmentConfig
from aerodaas.mission.commands import AddNavigation, ClearNavigation, End
from aerodaas.runtime.loop_calls import LoopCalls, LoopOverError
from aerodaas.runtime.reports import LATENCIES_KEPT, Latencies
from aerodaas.runtime.session import Session
from aerodaas.service.flights.locks import RobotLocks
from aerodaas.types.clock import NANOSECONDS, host_time_ns
from aerodaas.types.errors import MissionError
from aerodaas.types.status import MissionState

_READS = 100_000
_ON_GROUND = {MissionState.IDLE, MissionState.PREFLIGHT, MissionState.TAKING_OFF}
_HOLD = {"on_complete": "hold"}


def _square(name: str) -> AeroNavigation:
    places = [(3, 0), (3, 3), (0, 3), (0, 0)]
    stops = [Waypoint(f"{name}-{i}", x, y, 2.0) for i, (x, y) in enumerate(places)]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, stops, priority=len(name) % 3)


def test_reading_never_meets_a_mission_that_changes() -> None:
    """100,000 reads from four threads while commands and plans turn the queue over: none raises.

    Reports are whole: the target is not among what is pending, nothing is visited twice.
    """
    actor = drone_by_hand(AddNavigation(_square("first")), speed=4.0, mission=_HOLD)
    actor.start(host_time_ns())
    done = threading.Event()
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)

    def read() -> int:
        stamps = []
        for _ in range(_READS // 4):
            report = actor.robots()["drone"]
            status = report.status
            assert status.target not in status.pending
            assert len(set(status.visited)) == len(status.visited)
            stamps.append(status.stamp)
        assert stamps == sorted(stamps)
        return len(set(stamps))

    def command(sender: str) -> int:
        for number in itertools.count():
            if done.is_set():
                return number
            adding = AddNavigation(_square(f"{sender * (1 + number % 3)}{number}"))
            answer = actor.command("drone", adding if number % 4 else ClearNavigation())
            assert answer.accepted, answer.text
            assert not answer.refused
        raise AssertionError

    try:
        with ThreadPoolExecutor(6) as pool:
            commanding = [pool.submit(command, sender) for sender in "ab"]
            seen = [future.result() for future in [pool.submit(read) for _ in range(4)]]
            done.set()
            obeyed = [future.result() for future in commanding]
    finally:
        done.set()
        sys.setswitchinterval(interval)
    assert min(seen) > 1
    assert min(obeyed) > 10
    assert actor.report().error is None
    _land(actor)


def test_a_report_says_what_a_command_did_as_soon_as_it_is_answered() -> None:
    """Who commands and then reads sees its own command's effect."""
    actor = drone_by_hand(AddNavigation(hop((5, 0), hover=900)), speed=1.0, mission=_HOLD)
    assert actor.robots()["drone"].status.state is MissionState.IDLE
    actor.start(host_time_ns())
    assert actor.command("drone", AddNavigation(_square("more"))).accepted
    assert len(actor.robots()["drone"].status.pending) == 5
    assert actor.command("drone", ClearNavigation()).accepted
    assert actor.robots()["drone"].status.pending == ()
    _land(actor)


def test_commands_after_the_end_are_refused_at_once() -> None:
    """The loop turns no more, and the answer says how the mission ended."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=20.0)
    actor.start(host_time_ns())
    _until_over(actor)
    before = actor.robots()["drone"]
    assert before.status.state is MissionState.LANDED
    began = time.monotonic()
    answer = actor.command("drone", End())
    assert time.monotonic() - began < 1.0
    assert not answer.accepted
    assert answer.text == "the mission is over: landed"
    actor.stop()
    assert actor.robots()["drone"] == before


def test_a_command_that_raises_is_its_senders_failure() -> None:
    """What the loop carries out for somebody raises there, and the loop goes on."""
    calls = LoopCalls(lambda: None)
    loop = threading.Thread(target=lambda: _serve_until(calls, 3))
    loop.start()
    with pytest.raises(ZeroDivisionError):
        calls.ask(lambda: 1 // 0, 5.0)
    assert calls.ask(lambda: 7, 5.0) == 7
    assert calls.ask(threading.get_ident, 5.0) == loop.ident
    loop.join()
    calls.close("the mission is over")
    with pytest.raises(LoopOverError, match="the mission is over"):
        calls.ask(lambda: 8, 5.0)


def test_what_a_call_changed_is_published_before_it_is_answered() -> None:
    """A caller that reads afterwards reads its own call's effect, in a loop however slow."""
    value, published = [0], [0]

    def publish() -> None:
        time.sleep(0.05)
        published[0] = value[0]

    def add() -> None:
        value[0] += 1

    calls = LoopCalls(lambda: None, publish)
    loop = threading.Thread(target=lambda: _serve_until(calls, 3))
    loop.start()
    for count in range(1, 4):
        calls.ask(add, 5.0)
        assert published == [count]
    loop.join()


def test_a_command_that_nobody_came_to_is_not_obeyed_later() -> None:
    """Its sender was told that it was withdrawn."""
    made: list[int] = []
    calls = LoopCalls(lambda: None)
    with pytest.raises(MissionError, match="withdrawn"):
        calls.ask(lambda: made.append(1), 0.01)
    assert calls.serve() == 0
    assert made == []


def test_the_newest_latencies_are_given_in_their_order() -> None:
    """As many as asked for, or all there are."""
    known = Latencies()
    assert known.newest(3) == ()
    for value in (1.0, 2.0, 3.0):
        known.append(value)
    assert known.newest(2) == (2.0, 3.0)
    assert known.newest(9) == (1.0, 2.0, 3.0)
    assert known.newest(0) == ()


def test_latencies_kept_do_not_grow_with_the_flight() -> None:
    """The newest are kept, however many there were."""
    known = Latencies()
    for value in range(5 * LATENCIES_KEPT):
        known.append(float(value))
    kept = known.newest(10 * LATENCIES_KEPT)
    assert LATENCIES_KEPT <= len(kept) <= 2 * LATENCIES_KEPT
    assert kept[-1] == 5 * LATENCIES_KEPT - 1
    assert kept == tuple(float(value) for value in range(int(kept[0]), 5 * LATENCIES_KEPT))


def test_a_change_is_told_to_a_call_that_waits() -> None:
    """A command's effect answers the call, which otherwise waits; the end answers it, too."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=1.0, mission=_HOLD)
    actor.start(host_time_ns())
    known = 0
    while actor.robots()["drone"].status.state is not MissionState.TAKING_OFF:
        known = actor.await_change(known, 60.0)
    with ThreadPoolExecutor(1) as pool:
        known = actor.await_change(-1, 60.0)
        waiting = pool.submit(actor.await_change, known, 60.0)
        assert actor.command("drone", End()).accepted
        assert waiting.result() > known
        while actor.report().phase == "running":
            known = actor.await_change(known, 60.0)
    # Aborted if it was asked to land before it had taken off.
    ended = {MissionState.LANDED, MissionState.ABORTED}
    assert actor.robots()["drone"].status.state in ended
    assert actor.await_change(known, 60.0) >= known
    actor.stop()


def test_a_call_that_waits_for_a_change_returns_without_one() -> None:
    """The same value is no change, and one that was missed answers at once."""
    signal = ChangeSignal()
    signal.note("here")
    assert signal.wait(0, 60.0) == 1
    signal.note("here")
    assert signal.wait(1, 0.01) == 1
    signal.note("there")
    assert signal.wait(1, 60.0) == 2
    signal.end()
    assert signal.wait(2, 60.0) == 3
    assert signal.wait(3, 60.0) == 3


def test_an_alert_in_the_same_words_is_told_again_only_after_a_while() -> None:
    """Others are told at once; what is told goes by mission time."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=20.0)
    second = 1_000_000_000
    for stamp in range(12):
        actor.publish_alert("kind", "the same", stamp * second, {})
        actor.publish_alert("kind", f"another {stamp}", stamp * second, {})
    told = [one for one in actor.report().alerts if one.text == "the same"]
    assert [one.header.stamp // second for one in told] == [0, 5, 10]
    assert len(actor.report().alerts) == 15
    actor.stop()


def test_what_is_told_while_connecting_has_the_missions_time() -> None:
    """Mission time stands at zero before the start, however long that takes."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=1.0)
    actor.alert("kind", "before")
    actor.start(host_time_ns())
    actor.alert("kind", "after")
    before, after = (one for one in actor.report().alerts if one.kind == "kind")
    assert before.header.stamp == 0
    assert after.header.stamp > 0
    _land(actor)


def test_what_joins_in_flight_has_the_missions_time_before_it_starts() -> None:
    """An actor that is restarted opens its work in the middle of a mission."""
    actor = drone_by_hand(AddNavigation(hop((1, 0))), speed=2.0)
    actor.set_origin(host_time_ns() - 30 * NANOSECONDS)
    actor.alert("kind", "while opening")
    (alert,) = (one for one in actor.report().alerts if one.kind == "kind")
    assert alert.header.stamp >= 60 * NANOSECONDS
    actor.stop()


def _serve_until(calls: LoopCalls, count: int) -> None:
    while count > 0:
        count -= calls.serve()


def _until_over(actor: DroneByHand) -> None:
    end = time.monotonic() + 60.0
    while actor.report().phase == "running":
        assert time.monotonic() < end
        time.sleep(0.01)


def _land(actor: DroneByHand) -> None:
    end = time.monotonic() + 60.0
    while actor.robots()["drone"].status.state in _ON_GROUND:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert actor.command("drone", End()).accepted
    _until_over(actor)
    assert actor.robots()["drone"].status.state is MissionState.LANDED
    actor.stop()


def test_alerts_of_drones_on_one_link_say_whose_they_are() -> None:
    """Both tell the same at once; neither is lost, and each names its own drone."""
    robots = [robot(id=name, sensors=[], settings={"battery": 0.1}) for name in ("west", "east")]
    environment = EnvironmentConfig.model_validate(
        {"name": "shared", "robots": robots, "simulation": {"world": "empty"}}
    )
    specs = tuple(spec_by_hand(one, AddNavigation(hop((1, 0)))) for one in environment.robots)
    actor = DroneByHand(Session(environment, 20.0), "drone/west+east", specs)
    actor.open_here()
    actor.start(host_time_ns())
    _until_over(actor)
    told = [one for one in actor.report().alerts if one.kind == "takeoff_refused"]
    actor.stop()
    assert {one.header.source for one in told} == {"drone/west", "drone/east"}


def test_a_drone_is_held_by_the_actor_that_brings_it_home(tmp_path: Path) -> None:
    """Where the process of its flight was killed: no other flight begins until it is over."""
    folder = tmp_path / "locks"
    folder.mkdir()
    locks = RobotLocks(folder)
    actor = drone_by_hand(speed=1.0, locks=folder)
    assert locks.held(["drone", "other"]) == {"drone"}
    with pytest.raises(MissionError, match="still flies drone"), locks.hold(["drone"]):
        pass
    with pytest.raises(MissionError, match="still flies drone"):
        drone_by_hand(speed=1.0, locks=folder)
    actor.stop()
    with locks.hold(["drone"]):
        assert locks.held(["drone"]) == {"drone"}

"""Motors that stop: a landing on the ground, the end of the mission in the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import Flight, KinematicVehicle, add, flight, live, square
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.clock import NANOSECONDS
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.vehicle import FlightEnd, VehicleMode, VehicleState
from aerodaas.messages.waypoints import NavigationType, VelocityCommand, Waypoint
from aerodaas.mission.commands import End, Pause, ReturnHome, StreamItem
from aerodaas.mission.safety.motors import Motors, MotorWatch


def aborted_in_flight(one: Flight) -> None:
    """It ended at once, said so once, and says where."""
    one.expect(S.ABORTED)
    assert one.status.reason.startswith("motors stopped in flight at E ")
    told = [alert for alert in one.mission.alerts if alert.kind == "motors_stopped"]
    assert [alert.text for alert in told] == [one.status.reason]


def following() -> Flight:
    """A drone that flies by velocity commands."""
    one = flight(live())
    one.run_to(S.HOLDING)
    command = VelocityCommand(1.0, 0.0, 0.0, 0.0)
    item = AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])
    one.tell(StreamItem("drone/follow", item))
    one.run_to(S.FOLLOWING)
    return one


def in_state(state: S) -> Flight:
    """A flight that has come to this state."""
    if state is S.FOLLOWING:
        return following()
    hover = 30.0 if state is S.LOITERING else 0.0
    one = flight(add(*square(hover=hover)))
    if state is S.PAUSED:
        one.run_to(S.ENROUTE)
        one.tell(Pause())
    elif state is S.RETURNING:
        one.run(12.0)
        one.tell(ReturnHome())
    elif state is S.DIVERTED:
        one.run(12.0)
        one.tell(add(Waypoint("urgent", 5, 5, 2.0, priority=1)))
    one.run_to(state)
    return one


@pytest.mark.parametrize(
    "state", [S.ENROUTE, S.LOITERING, S.FOLLOWING, S.DIVERTED, S.PAUSED, S.RETURNING]
)
def test_motors_that_stop_in_flight_end_the_mission(state: S) -> None:
    """At once, in every state, whatever else is asked; what was visited stays visited."""
    one = in_state(state)
    visited, asked = one.status.visited, list(one.vehicle.calls)
    one.vehicle.kill()
    one.turn()
    aborted_in_flight(one)
    for _ in range(40):
        assert one.turn().sent is None
    aborted_in_flight(one)
    assert one.status.visited == visited
    assert one.vehicle.calls == asked


@pytest.mark.parametrize("lost", [False, True])
def test_a_fall_that_the_vehicle_knows_of_is_no_takeover(lost: bool) -> None:  # noqa: FBT001
    """A driver may say that it falls, disarmed and not grounded; before, it may not be heard."""
    one = flight(add(*square()))
    one.run(12.0)
    one.vehicle.lost = lost
    one.run(0.5)
    falling = replace(
        one.vehicle.read(), mode=VehicleMode.FAILSAFE, armed=False, ended=FlightEnd.FELL
    )
    one.vehicle.read = lambda: falling  # type: ignore[method-assign]
    one.turn()
    aborted_in_flight(one)
    assert [alert.kind for alert in one.mission.alerts][-1] == "motors_stopped"


def test_a_collision_that_the_vehicle_tells_ends_the_mission() -> None:
    """An alert tells it while the drone falls; the mission ends with the same words."""
    one = flight(add(*square()))
    one.run(12.0)
    hit = "collision with building barn at (1.0, 2.0, 3.0) at 2.1 m/s"
    one.vehicle.faults = (hit,)
    one.run(0.5)
    assert [(alert.kind, alert.text) for alert in one.mission.alerts] == [("collision", hit)]
    state = replace(one.vehicle.read(), mode=VehicleMode.GROUNDED, armed=False)
    one.vehicle.read = lambda: replace(state, ended=FlightEnd.FELL)  # type: ignore[method-assign]
    one.turn()
    one.expect(S.ABORTED)
    assert one.status.reason == hit


def test_a_vehicle_that_lands_by_itself_on_higher_ground_did_not_fall() -> None:
    """The driver's word decides, not the height; why it landed is told, and that once."""
    one = flight(add(Waypoint("far", 60, 0, 4.0)))
    one.run(12.0)
    hot = "it is hot inside: 90 °C"
    stands = replace(
        one.vehicle.read(),
        mode=VehicleMode.FAILSAFE,
        armed=False,
        ended=FlightEnd.LANDED,
        faults=(hot,),
    )
    assert stands.odometry.height > 1.0
    one.vehicle.read = lambda: stands  # type: ignore[method-assign]
    one.run(3.0)
    one.expect(S.ABORTED)
    assert one.status.reason.startswith("landed of its own accord at E ")
    assert one.status.reason.endswith(f"m: {hot}")
    assert [alert.text for alert in one.mission.alerts] == [one.status.reason]


def test_the_word_of_the_driver_decides() -> None:
    """A landing however fast, a fall however gentle; how an older flight ended says nothing."""
    for ended, verdict in (
        (FlightEnd.LANDED, Motors.LANDED),
        (FlightEnd.FELL, Motors.STOPPED_IN_FLIGHT),
    ):
        watch = MotorWatch(np.zeros(3))
        older = replace(seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False), ended=ended)
        assert watch.observe(older, 0) is Motors.IDLE
        for mode in (VehicleMode.TAKING_OFF, VehicleMode.HOLDING):
            climbing = replace(seen(2.0, 0.0, mode, armed=False), ended=ended)
            assert watch.observe(climbing, 1) is Motors.RUNNING
        speed = -0.5 if ended is FlightEnd.FELL else -4.0
        watch.observe(seen(1.0, speed, VehicleMode.LANDING, armed=True), 2)
        assert watch.observe(older, 3) is verdict


def test_a_failsafe_says_what_it_is_for() -> None:
    """The vehicle's complaints are in the reason, those of a second later, too."""
    one = flight(add(*square()))
    one.run(12.0)
    one.vehicle.mode = VehicleMode.FAILSAFE
    one.run(1.0)
    assert not one.tell(ReturnHome()).accepted
    one.vehicle.faults = ("battery: critical", "GPS: no fix")
    one.run(3.0)
    one.expect(S.ABORTED)
    said = "the vehicle's own protection has taken over: battery: critical; GPS: no fix"
    assert one.status.reason == said
    assert [alert.text for alert in one.mission.alerts] == [said]


@pytest.mark.parametrize("state", [S.ENROUTE, S.PAUSED])
def test_a_landing_that_was_not_asked_for_is_no_fall(state: S) -> None:
    """The mission ends unfinished, and says that the drone came down by itself."""
    one = in_state(state)
    one.vehicle.land()
    one.vehicle.send = lambda setpoint: setpoint  # type: ignore[method-assign] # whatever is asked
    one.vehicle.hold = lambda: None  # type: ignore[method-assign]
    one.run(until=lambda: one.mission.finished)
    one.expect(S.ABORTED)
    assert one.status.reason.startswith("landed of its own accord at E ")
    assert [alert.text for alert in one.mission.alerts] == [one.status.reason]


def test_the_place_is_where_the_motors_last_ran() -> None:
    """Not where the drone fell to."""
    one = flight(add(Waypoint("far", 20, 0, 4.0)))
    one.run(15.0)
    east, north, up = one.track[-1]
    one.vehicle.kill()
    one.run()
    expected = f"motors stopped in flight at E {east:.1f}, N {north:.1f}, up {up:.1f} m"
    assert one.status.reason == expected


@pytest.mark.parametrize("up", [4.0, 2.0, 1.0, 0.6])
def test_motors_that_stop_on_the_way_down_are_no_landing(up: float) -> None:
    """However gently the drone came down until then, and however late one hears of it."""
    one = flight(add(Waypoint("here", 1, 0, 4.0, hover_duration=5.0)))
    one.run_to(S.LOITERING)
    one.tell(End())
    one.run(until=lambda: bool(one.vehicle.position[2] <= up))
    one.expect(S.LANDING)
    one.vehicle.kill()
    one.run(5.0)
    aborted_in_flight(one)


def test_a_fall_that_is_heard_of_when_it_is_over_is_no_landing() -> None:
    """The vehicle tells of its motors once a second; until then it seems to be landing."""
    one = flight(add(Waypoint("here", 1, 0, 2.0, hover_duration=5.0)))
    one.run_to(S.LOITERING)
    one.tell(End())
    one.run(1.0)
    watch = MotorWatch(np.zeros(3))
    stamp = 0
    verdict = Motors.IDLE
    for height, speed, armed in [
        *[(2.0, -0.5, True)] * 10,
        (1.5, -3.0, True),
        (0.5, -5.0, True),
        *[(0.0, 0.0, True)] * 8,
        *[(0.0, 0.0, False)] * 20,
    ]:
        mode = VehicleMode.LANDING if armed else VehicleMode.GROUNDED
        verdict = watch.observe(seen(height, speed, mode, armed=armed), stamp)
        stamp += NANOSECONDS // 20
    assert verdict is Motors.STOPPED_IN_FLIGHT


def seen(height: float, speed: float, mode: VehicleMode, *, armed: bool) -> VehicleState:
    """A vehicle above its place of take-off that climbs at `speed`."""
    odometry = Odometry(np.array([0.0, 0.0, height]), np.array([0.0, 0.0, speed]), 0.0)
    return VehicleState(0, odometry, Battery(1.0), mode, armed)


@given(
    ground=st.floats(-20, 20),
    speed=st.floats(0.1, 1.5),
    late=st.integers(0, 40),
    noise=st.floats(0.0, 0.3),
)
@settings(max_examples=60)
def test_a_gentle_landing_is_one_on_any_ground(
    ground: float, speed: float, late: int, noise: float
) -> None:
    """Higher or lower than home, however soon after the touch the motors stop."""
    watch, stamp = MotorWatch(np.zeros(3)), 0
    height, verdict = max(ground, 0.0) + 3.0, Motors.IDLE
    while height > ground:
        verdict = watch.observe(seen(height, -speed, VehicleMode.LANDING, armed=True), stamp)
        height, stamp = height - speed / 20, stamp + NANOSECONDS // 20
    for turn in range(late + 20):
        armed = turn < late
        mode = VehicleMode.LANDING if armed else VehicleMode.GROUNDED
        shaken = noise if turn % 2 else -noise
        verdict = watch.observe(seen(ground, shaken, mode, armed=armed), stamp)
        stamp += NANOSECONDS // 20
    assert verdict is Motors.LANDED


def test_a_landing_that_nobody_heard_is_one_where_its_place_is_known() -> None:
    """A vehicle comes home by itself while the link is down; one that was restarted does not."""
    for known, verdict in ((True, Motors.LANDED), (False, Motors.STOPPED_IN_FLIGHT)):
        watch, stamp = MotorWatch(np.zeros(3)), 0
        watch.observe(seen(3.0, 0.0, VehicleMode.GUIDED, armed=True), stamp)
        watch.observe(seen(3.0, 0.0, VehicleMode.LOST, armed=True), NANOSECONDS)
        height = 0.0 if known else np.nan
        heard = Motors.RUNNING
        for _ in range(20):
            stamp += NANOSECONDS
            heard = watch.observe(seen(height, 0.0, VehicleMode.GROUNDED, armed=False), stamp)
        assert heard is verdict


def test_a_landing_counts_when_the_drone_has_settled() -> None:
    """Until then the mission is landing; then it has landed, for the reason it had."""
    one = flight(add(*square()))
    one.run(10.0)
    one.tell(End("enough"))
    one.run(until=lambda: one.vehicle.mode is VehicleMode.GROUNDED)
    one.expect(S.LANDING)
    one.run(0.4)
    one.expect(S.LANDING)
    one.run(0.5)
    one.expect(S.LANDED)
    assert one.status.reason == "enough"


class Slow(KinematicVehicle):
    """Takes a second to start its motors, and stops them when told to land before."""

    starting: int | None = None

    def take_off(self, height: float) -> None:
        """Start in a second."""
        self.calls.append("take_off")
        self.starting = self._now + NANOSECONDS
        self._height = height

    def land(self) -> None:
        """Withdraw the order, or land."""
        super().land()
        if self.starting is not None:
            self.starting, self.mode = None, VehicleMode.GROUNDED

    def read(self) -> VehicleState:
        """Say that it is taking off while it may still do so."""
        if self.starting is not None and self._now >= self.starting:
            self.starting, self.mode = None, VehicleMode.TAKING_OFF
        state = super().read()
        if self.starting is None:
            return state
        return VehicleState(
            state.stamp, state.odometry, state.battery, VehicleMode.TAKING_OFF, armed=False
        )


@pytest.mark.parametrize("turns", [1, 2, 6, 19, 20, 21, 25])
@pytest.mark.parametrize("command", [End("stop"), ReturnHome("stop")])
def test_an_abort_in_the_first_second_is_told_truly(turns: int, command: End | ReturnHome) -> None:
    """On the ground it ends as aborted before take-off, and the motors never start after that."""
    one = flight(add(*square()), vehicle=Slow())
    for _ in range(turns):
        one.turn()
    one.tell(command)
    one.run(30.0)
    up = max(float(position[2]) for position in one.track)
    one.expect(S.LANDED if up > 0.3 else S.ABORTED)
    if up <= 0.3:
        assert one.status.reason == "stop before take-off"
    ended = one.now
    for _ in range(60):
        one.turn()
    assert one.now > ended
    assert one.vehicle.mode is VehicleMode.GROUNDED
    assert one.vehicle.position[2] == pytest.approx(0.0, abs=0.01)


def test_lifting_is_counted_from_the_place_of_take_off() -> None:
    """Motors that stop again on a roof or in a pit have flown nowhere."""
    for home in (5.0, -5.0):
        watch = MotorWatch(np.array([0.0, 0.0, home]))
        watch.observe(seen(home, 0.0, VehicleMode.TAKING_OFF, armed=True), 0)
        stopped = seen(home, 0.0, VehicleMode.GROUNDED, armed=False)
        assert watch.observe(stopped, NANOSECONDS) is Motors.NEVER_LIFTED


def descended(watch: MotorWatch) -> int:
    """Come down gently from 3 m, landing; returns when the motors are still running, ns."""
    stamp = 0
    for height in np.linspace(3.0, 0.0, 41):
        watch.observe(seen(float(height), -0.5, VehicleMode.LANDING, armed=True), stamp)
        stamp += NANOSECONDS // 20
    return stamp


@pytest.mark.parametrize(("after", "verdict"), [(0, Motors.STOPPED_IN_FLIGHT), (1, Motors.LANDED)])
def test_a_fall_counts_for_a_second(after: int, verdict: Motors) -> None:
    """One that began exactly a second before the stop was seen does; a nanosecond more does not."""
    watch = MotorWatch(np.zeros(3))
    began = descended(watch)
    watch.observe(seen(0.2, -2.01, VehicleMode.LANDING, armed=True), began)
    stopped = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    stamp = began + NANOSECONDS + after
    watch.observe(stopped, stamp)
    assert watch.observe(stopped, stamp + NANOSECONDS) is verdict


def test_sinking_at_just_two_metres_a_second_is_still_gentle() -> None:
    """At the limit it is a landing."""
    watch = MotorWatch(np.zeros(3))
    stamp = descended(watch)
    watch.observe(seen(0.1, -2.0, VehicleMode.LANDING, armed=True), stamp)
    stopped = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    watch.observe(stopped, stamp + 1)
    assert watch.observe(stopped, stamp + NANOSECONDS) is Motors.LANDED


def test_a_landing_has_settled_after_half_a_second() -> None:
    """Exactly then, and no earlier; after that it stays a landing whatever is told."""
    watch = MotorWatch(np.zeros(3))
    stamp = descended(watch)
    stopped = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    half = NANOSECONDS // 2
    assert watch.observe(stopped, stamp) is Motors.SETTLING
    assert watch.observe(stopped, stamp + half - 1) is Motors.SETTLING
    assert watch.observe(stopped, stamp + half) is Motors.LANDED
    shaken = seen(0.0, -9.0, VehicleMode.GROUNDED, armed=False)
    assert watch.observe(shaken, stamp + half + 1) is Motors.LANDED


@pytest.mark.parametrize("speed", [np.nan, -np.inf])
def test_a_sink_rate_that_is_no_number_is_no_fall(speed: float) -> None:
    """What is not known is passed by, before and after the motors stop."""
    watch = MotorWatch(np.zeros(3))
    stamp = descended(watch)
    watch.observe(seen(0.0, speed, VehicleMode.LANDING, armed=True), stamp)
    stopped = seen(0.0, speed, VehicleMode.GROUNDED, armed=False)
    watch.observe(stopped, stamp)
    assert watch.observe(stopped, stamp + NANOSECONDS) is Motors.LANDED


def test_after_a_lost_link_a_vehicle_has_five_seconds_to_say_where_it_is() -> None:
    """It stands, by its own word, and may have come home; without a place it has fallen."""
    nowhere = seen(np.nan, 0.0, VehicleMode.GROUNDED, armed=False)
    placed = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    for last, answer in ((placed, Motors.LANDED), (nowhere, Motors.STOPPED_IN_FLIGHT)):
        watch = MotorWatch(np.zeros(3))
        watch.observe(seen(3.0, 0.0, VehicleMode.GUIDED, armed=True), 0)
        watch.observe(seen(3.0, 0.0, VehicleMode.LOST, armed=True), NANOSECONDS)
        for second in (2, 4, 6.999):
            heard = watch.observe(nowhere, round(second * NANOSECONDS))
            assert heard is Motors.SETTLING, second
        assert watch.observe(last, 7 * NANOSECONDS) is answer


def test_a_link_that_came_back_in_flight_explains_no_stop() -> None:
    """The vehicle was heard flying since: motors that stop then have stopped in flight."""
    watch = MotorWatch(np.zeros(3))
    watch.observe(seen(3.0, 0.0, VehicleMode.GUIDED, armed=True), 0)
    watch.observe(seen(3.0, 0.0, VehicleMode.LOST, armed=True), NANOSECONDS)
    watch.observe(seen(3.0, 0.0, VehicleMode.GUIDED, armed=True), 2 * NANOSECONDS)
    stopped = seen(3.0, 0.0, VehicleMode.GROUNDED, armed=False)
    assert watch.observe(stopped, 3 * NANOSECONDS) is Motors.STOPPED_IN_FLIGHT


def test_a_fall_before_any_position_was_known_is_placed_at_home() -> None:
    """The driver knows of the fall; where the drone was last is where it took off."""
    home = np.array([4.0, -2.0, 1.0])
    watch = MotorWatch(home)
    climbing = seen(np.nan, 1.0, VehicleMode.TAKING_OFF, armed=True)
    assert watch.observe(climbing, 0) is Motors.RUNNING
    fallen = replace(seen(np.nan, 0.0, VehicleMode.GROUNDED, armed=False), ended=FlightEnd.FELL)
    assert watch.observe(fallen, NANOSECONDS) is Motors.STOPPED_IN_FLIGHT
    assert watch.place.tolist() == home.tolist()


@pytest.mark.parametrize(("up", "verdict"), [(0.3, Motors.NEVER_LIFTED), (0.31, Motors.SETTLING)])
def test_a_drone_has_lifted_above_thirty_centimetres(up: float, verdict: Motors) -> None:
    """At the limit it still stands."""
    watch = MotorWatch(np.zeros(3))
    watch.observe(seen(up, 0.0, VehicleMode.LANDING, armed=True), 0)
    stopped = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    assert watch.observe(stopped, NANOSECONDS) is verdict


def test_motors_that_run_again_are_watched_anew() -> None:
    """A drone that was kicked off and flies is not one that has landed."""
    watch = MotorWatch(np.zeros(3))
    stamp = descended(watch)
    stopped = seen(0.0, 0.0, VehicleMode.GROUNDED, armed=False)
    watch.observe(stopped, stamp)
    flying = seen(2.0, 0.0, VehicleMode.GUIDED, armed=True)
    assert watch.observe(flying, stamp + NANOSECONDS) is Motors.RUNNING
    killed = seen(2.0, 0.0, VehicleMode.GROUNDED, armed=False)
    assert watch.observe(killed, stamp + 2 * NANOSECONDS) is Motors.STOPPED_IN_FLIGHT

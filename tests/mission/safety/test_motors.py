"""Motors that stop: a landing on the ground, the end of the mission in the air."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from flights import Flight, KinematicVehicle, add, flight, live, square
from hypothesis import given, settings
from hypothesis import strategies as st

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.mission.commands import End, Pause, ReturnHome, StreamItem
from aerodaas.mission.safety.motors import Motors, MotorWatch
from aerodaas.types.clock import NANOSECONDS
from aerodaas.types.data import Battery, Odometry
from aerodaas.types.status import MissionState as S
from aerodaas.types.vehicle import FlightEnd, VehicleMode, VehicleState
from aerodaas.types.waypoints import NavigationType, VelocityCommand, Waypoint


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
    """The vehicle's complaints are in the reason."""
    one = flight(add(*square()))
    one.run(12.0)
    one.vehicle.faults = ("battery: critical", "GPS: no fix")
    one.vehicle.mode = VehicleMode.FAILSAFE
    one.turn()
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
@settings(max_examples=60, deadline=None)
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

"""What the driver says is so: motors that stopped, restarts, jumps, packets that say nothing."""

from __future__ import annotations

import contextlib
import logging
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from autopilot import STILL
from emulated import FAMILIES, Flight, Stepped

from aerodaas.drivers.mavlink import connecting
from aerodaas.errors import VehicleError
from aerodaas.messages.vehicle import (
    FlightEnd,
    PositionSetpoint,
    VehicleMode,
    VehicleState,
    VelocitySetpoint,
)
from tools.mavlink_vehicle import AutopilotOptions

THERE = np.array([6.0, 3.0, 12.0])


@pytest.fixture(params=FAMILIES)
def world(request: pytest.FixtureRequest, flight: Flight) -> Iterator[Stepped]:
    """One of each family, 12 m up, guided to a place off home; it does not begin at zero."""
    options = AutopilotOptions(family=request.param, estimator_origin=(20.0, -9.0, 3.0))
    with flight(options) as flown:
        flown.guide(12.0)
        flown.stream(PositionSetpoint(THERE, None, 3.0), 8.0)
        yield flown


def told(state: VehicleState, words: str) -> bool:
    """Whether one of the faults says so."""
    return any(words in fault for fault in state.faults)


def test_motors_stopped_in_the_air_are_no_landing(world: Stepped) -> None:
    """Disarmed at once, grounded only when it lies, and said by name until motors start again."""
    world.autopilot.stop_motors()
    state = world.turn()
    while state.armed:
        state = world.turn()
    assert state.mode is VehicleMode.FAILSAFE
    assert state.ended is FlightEnd.FELL
    assert told(state, "motors: stopped in flight")
    with pytest.raises(VehicleError, match="own protection"):
        world.vehicle.send(VelocitySetpoint(np.zeros(3)))
    state = world.until(VehicleMode.GROUNDED)
    assert float(world.autopilot.truth.position[2]) < 0.1
    assert not state.armed
    assert told(world.watch(20.0)[-1], "motors: stopped in flight")
    world.vehicle.preflight()
    world.watch(1.0)
    world.vehicle.take_off(2.0)
    assert not told(world.until(VehicleMode.HOLDING, VehicleMode.GUIDED), "motors")


def test_an_autopilot_that_starts_anew_in_flight(world: Stepped) -> None:
    """Told, disarmed, and its new frame is laid over the earth before a position is believed."""
    world.autopilot.restart()
    states = world.watch(12.0)
    assert not states[-1].armed
    assert all(state.armed or state.mode is not VehicleMode.RETURNING for state in states)
    # Before its first HEARTBEAT, too: a mission must not take this for a failsafe that flies.
    assert not any(state.armed for state in states if state.mode is VehicleMode.FAILSAFE)
    assert told(states[-1], "autopilot: it started anew in flight")
    lying = world.autopilot.truth.position
    # A moment ago it was up there; that is told with its age until it speaks again.
    for state in states[42:]:
        position = state.odometry.position
        assert not np.isfinite(position).all() or np.allclose(position, lying, atol=1.0)
    assert states[-1].odometry.position == pytest.approx(lying, abs=1.0)
    assert states[-1].mode is VehicleMode.GROUNDED


def test_an_autopilot_that_starts_anew_while_being_connected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where its old frame lay says nothing about the new one: it is not flown by it."""
    world = Stepped(monkeypatch, fence="land")

    def uploaded(*_: object) -> None:
        world.advance(20.0)
        world.autopilot.restart()
        world.advance(8.0)

    monkeypatch.setattr(connecting, "upload_fence", uploaded)
    with pytest.raises(VehicleError, match="started anew while being connected"), world:
        pass
    assert not world.vehicle.connected


def test_a_local_frame_that_jumps(world: Stepped) -> None:
    """Not believed until global positions show where the frame lies now; nothing chases it."""
    world.autopilot.shift_frame(np.array([30.0, -40.0, 0.0]))
    state = world.turn()
    while np.isfinite(state.odometry.position).all():
        assert np.allclose(state.odometry.position, THERE, atol=1.0)
        state = world.turn()
    assert told(state, "position: jumped by 50 m")
    sent = world.vehicle.send(PositionSetpoint(np.array([50.0, 0.0, 12.0])))
    assert isinstance(sent, VelocitySetpoint)
    assert float(np.linalg.norm(sent.velocity)) == 0.0
    while not np.isfinite(state.odometry.position).all():
        world.vehicle.send(VelocitySetpoint(np.zeros(3)))
        state = world.turn()
    assert state.odometry.position == pytest.approx(world.autopilot.truth.position, abs=0.5)
    state = world.stream(PositionSetpoint(THERE, None, 3.0), 12.0)
    assert world.autopilot.truth.position == pytest.approx(THERE, abs=0.5)
    assert not told(state, "position")


def test_what_it_no_longer_knows_is_told(world: Stepped) -> None:
    """A lost fix by its name; packets with old stamps are a loss within two seconds."""
    there = PositionSetpoint(THERE, None, 3.0)
    world.autopilot.lose_gps()
    assert told(world.stream(there, 3.0), "GPS: no fix")
    world.autopilot.lose_gps(off=True)
    assert world.stream(there, 3.0).faults == ()
    world.autopilot.freeze()
    state = world.watch(2.0)[-1]
    assert state.mode is VehicleMode.LOST
    assert told(state, "telemetry: packets come, and say nothing new")
    world.autopilot.freeze(off=True)
    assert world.turn().mode is not VehicleMode.LOST


def test_a_log_that_blocks_holds_nobody_up(flight: Flight) -> None:
    """While the link's own thread hangs in a log, the control loop reads, flies and lands."""
    entered, let_go, done = threading.Event(), threading.Event(), threading.Event()

    class Blocking(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:  # noqa: ARG002 - the base's
            entered.set()
            let_go.wait(60.0)

    log = logging.getLogger("aerodaas.drivers.mavlink.vehicle")
    handler = Blocking()
    with flight(AutopilotOptions(family="ardupilot")) as ends:
        ends.guide()

        def turn() -> None:
            ends.vehicle.read()
            for deed in (lambda: ends.vehicle.send(STILL), ends.vehicle.land):
                with contextlib.suppress(VehicleError):
                    deed()
            done.set()

        log.addHandler(handler)
        link = threading.Thread(target=ends.advance, args=(2.0,), daemon=True)
        try:
            ends.autopilot.take_over()
            link.start()
            assert entered.wait(10.0)
            threading.Thread(target=turn, daemon=True).start()
            assert done.wait(10.0)
        finally:
            let_go.set()
            log.removeHandler(handler)
            link.join()

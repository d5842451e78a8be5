"""Take-offs over bad links, and take-offs that are called off: motors only when it says so."""

from __future__ import annotations

from typing import Any

import pytest
from stepped import Stepped

from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.control.withdrawal import Withdrawal
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot, Impairment

FAMILIES = ("px4", "ardupilot")
LOSSY = Impairment(loss=0.2, delay=0.1)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(10))
def test_a_lossy_link_costs_no_take_off(
    monkeypatch: pytest.MonkeyPatch, family: str, seed: int
) -> None:
    """A fifth of all packets lost, a tenth of a second each way: it arms and rises, once."""
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        seed=seed,
        uplink=LOSSY,
        downlink=LOSSY,
    )
    with Stepped(monkeypatch, options) as world:
        world.vehicle.take_off(2.0)
        state = world.until(VehicleMode.HOLDING, VehicleMode.GUIDED)
        assert state.odometry.height == pytest.approx(2.0, abs=0.3)
        motions = world.autopilot.firmware.motions
    assert motions.count("arm") == 1
    assert motions.count("take off") == 1


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize(
    ("link", "step"),
    [
        (Impairment(), 20),
        pytest.param(Impairment(), 4, marks=pytest.mark.slow),
        pytest.param(Impairment(delay=0.1, jitter=0.1), 4, marks=pytest.mark.slow),
        pytest.param(LOSSY, 4, marks=pytest.mark.slow),
    ],
)
def test_a_take_off_called_off_starts_no_motors_after_the_ground_is_told(
    monkeypatch: pytest.MonkeyPatch, family: str, link: Impairment, step: int
) -> None:
    """Called off after 0 to 3 s: landed where it flew, and still for good once it says grounded."""
    options = AutopilotOptions(
        family=family,  # type: ignore[arg-type]
        uplink=link,
        downlink=link,
    )
    flown = 0
    with Stepped(monkeypatch, options) as world:
        firmware = world.autopilot.firmware
        for hundredths in (*range(0, 100, step), 150, 200, 250, 300):
            firmware.motions.clear()
            world.vehicle.take_off(2.0)
            world.advance(hundredths / 100)
            world.vehicle.land()
            state = world.until(VehicleMode.GROUNDED)
            assert not state.armed
            assert not firmware.armed, hundredths
            before = list(firmware.motions)
            assert all(not one.armed for one in world.watch(4.0))
            assert firmware.motions == before, hundredths
            flown += "take off" in before
    assert 0 < flown < 29


@pytest.mark.parametrize("family", FAMILIES)
def test_before_anything_is_armed_the_ground_is_told_at_once(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """An order that starts no motors needs no taking back."""
    with Stepped(monkeypatch, AutopilotOptions(family=family)) as world:  # type: ignore[arg-type]
        world.autopilot.cut()
        world.vehicle.take_off(2.0)
        assert world.vehicle.read().mode is VehicleMode.TAKING_OFF
        world.vehicle.land()
        assert world.vehicle.read().mode is VehicleMode.GROUNDED
        world.autopilot.cut(off=False)
        world.watch(5.0)
        assert world.autopilot.firmware.motions == []


@pytest.mark.parametrize("family", FAMILIES)
def test_what_shows_to_be_done_needs_no_acknowledgement(
    monkeypatch: pytest.MonkeyPatch, family: str
) -> None:
    """Not one acknowledgement comes through: HEARTBEATs and landed states tell enough."""
    options = AutopilotOptions(family=family)  # type: ignore[arg-type]
    with Stepped(monkeypatch, options) as world:
        monkeypatch.setattr(EmulatedAutopilot, "_acknowledge", lambda *_: None)
        world.vehicle.take_off(2.0)
        world.until(VehicleMode.HOLDING, VehicleMode.GUIDED)
        motions = world.autopilot.firmware.motions
        numbers = [getattr(one, "command", None) for _, one in world.autopilot.heard]
    assert motions.count("arm") == 1
    assert motions.count("take off") == 1
    assert numbers.count(mavlink.MAV_CMD_COMPONENT_ARM_DISARM) <= 2
    assert numbers.count(mavlink.MAV_CMD_NAV_TAKEOFF) <= 3


def test_a_withdrawal_is_over_only_when_motors_have_stood_for_a_while() -> None:
    """Two HEARTBEATs, 1.5 s after the last word; motors that start begin it anew."""
    sent: list[Any] = []
    landed: list[float] = []
    commander = Commander(sent.append, (1, 1), 245)

    def answer(result: int, now: float) -> None:
        number = PX4.disarm().number
        ack = mavlink.MAVLink_command_ack_message(number, result, 0, 0, 245, 191)
        commander.take(ack, now)

    def land() -> None:
        landed.append(1.0)

    withdrawal = Withdrawal(commander, PX4.disarm(), land, 0.0, flies=False)
    withdrawal.observe(0.1, armed=False)
    answer(mavlink.MAV_RESULT_ACCEPTED, 0.2)
    over = []
    for now, armed in ((0.5, False), (1.4, False), (1.5, True), (2.5, False)):
        withdrawal.observe(now, armed=armed)
        over.append(withdrawal.over)
    assert len(sent) == 2
    answer(mavlink.MAV_RESULT_ACCEPTED, 2.6)
    for now in (2.7, 2.9, 3.1):
        withdrawal.observe(now, armed=False)
        over.append(withdrawal.over)
    assert over == [False] * 6 + [True]
    assert landed == []
    withdrawal = Withdrawal(commander, PX4.disarm(), land, 10.0, flies=False)
    answer(mavlink.MAV_RESULT_TEMPORARILY_REJECTED, 10.1)
    assert landed == [1.0]


def test_the_rest_of_a_climb_is_not_flown_from_the_ground(monkeypatch: pytest.MonkeyPatch) -> None:
    """PX4 shows hold while the order to take off is lost on the way: no setpoint, no offboard."""
    with Stepped(monkeypatch, AutopilotOptions(family="px4")) as world:
        commander = world.vehicle.connection.commander
        send, late = commander._send, world.now + 4.0

        def lossy(message: Any) -> None:  # noqa: ANN401 - pymavlink has no types
            if getattr(message, "command", 0) != mavlink.MAV_CMD_NAV_TAKEOFF or world.now > late:
                send(message)

        monkeypatch.setattr(commander, "_send", lossy)
        world.vehicle.take_off(3.0)
        while not world.vehicle.telemetry.armed or world.now < late:
            assert world.turn().mode in {VehicleMode.GROUNDED, VehicleMode.TAKING_OFF}
        heard = [message.get_type() for _, message in world.autopilot.heard]
        assert "SET_POSITION_TARGET_LOCAL_NED" not in heard
        state = world.until(VehicleMode.HOLDING, VehicleMode.GUIDED)
        assert state.odometry.height == pytest.approx(3.0, abs=0.5)

"""Take-offs over bad links, and take-offs that are called off: motors only when it says so."""

from __future__ import annotations

import pytest
from stepped import Stepped

from aerodaas.testing.mavlink import AutopilotOptions, Impairment
from aerodaas.vehicle import VehicleMode

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

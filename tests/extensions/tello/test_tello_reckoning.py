"""Dead reckoning knows where it is about as well as it says."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest

from aerodaas.extensions.tello.commands import Sticks, StickScale
from aerodaas.extensions.tello.reckoning import DeadReckoning
from aerodaas.extensions.tello.state import parse_state
from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.options import TelloOptions

SCALE = StickScale(speed=1.0, climb=1.0, turn=math.radians(100))
TICK = 0.05


class Dryrun:
    """A flight without sockets and without waiting."""

    def __init__(self, options: TelloOptions) -> None:
        self.flight = TelloFlight(options)
        self.reckoning = DeadReckoning(
            np.array(options.start, np.float64), math.radians(options.start_yaw)
        )
        self.ticks = 0

    def fly(self, sticks: Sticks | None, duration: float, *, packets: bool = True) -> None:
        """Fly by `sticks` (None: its own take-off or landing) with a packet every 0.1 s."""
        motion = SCALE.motion(sticks or Sticks())
        for _ in range(round(duration / TICK)):
            if sticks is not None:
                self.flight.steer(sticks.right, sticks.ahead, sticks.up, sticks.clockwise)
            self.flight.advance(TICK)
            self.ticks += 1
            now = self.ticks * TICK
            self.reckoning.predict(now, motion)
            state = parse_state(self.flight.state().encode())
            assert state is not None
            if packets and self.ticks % 2 == 0:
                self.reckoning.correct(state, now, standing=not self.flight.flying)

    def error(self) -> float:
        """Metres between the belief and the truth, level."""
        off = self.reckoning.odometry.position - self.flight.truth.position
        return math.hypot(off[0], off[1])


def _wander(seed: int, options: TelloOptions, legs: int = 20) -> Dryrun:
    run = Dryrun(options)
    draw = random.Random(seed).randint
    run.fly(None, 0.2)
    run.flight.take_off()
    run.fly(None, 4.0)
    for _ in range(legs):
        run.fly(Sticks(draw(-60, 60), draw(-60, 60), draw(-10, 15), draw(-50, 50)), 1.5)
    return run


def test_the_error_stays_within_the_stated_uncertainty() -> None:
    """Over many flights of half a minute, nearly all errors lie within two sigma of a Rayleigh."""
    shares = []
    for seed in range(12):
        options = TelloOptions(
            seed=seed, wind=(0.8, -0.4, 0.0), gust=0.3, stick_speed=0.9, switched_on_yaw=37.0 * seed
        )
        run = _wander(seed, options)
        assert run.reckoning.sigma < 2.0, "and the statement means something"
        shares.append(run.error() / run.reckoning.sigma)
    assert sum(share > 2.0 for share in shares) <= 1, shares
    assert max(shares) < 3.5


def test_slow_motion_is_not_lost_in_rounding() -> None:
    """At 4 cm/s every packet says 0.0 m/s; the model of the sticks tells that it moves."""
    run = Dryrun(TelloOptions())
    run.fly(None, 0.2)
    run.flight.take_off()
    run.fly(None, 4.0)
    run.fly(Sticks(ahead=4), 25.0)
    assert run.flight.truth.position[0] > 0.8
    assert run.reckoning.odometry.position[0] == pytest.approx(
        run.flight.truth.position[0], abs=0.15
    )

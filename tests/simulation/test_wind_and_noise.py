"""Wind and sensor noise have the statistics that they claim."""

from __future__ import annotations

import statistics

import numpy as np
import pytest

from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.simulation.airframe import Wind
from aerodaas.simulation.dynamics import STEP, KinematicState
from aerodaas.simulation.sensors import SensorNoise

MOTION = KinematicState((3.0, -2.0, 1.5), (0.5, 0.0, -0.1), 0.02, -0.01, 1.2, 0.1)


def test_gusts_have_their_mean_and_deviation() -> None:
    """Over many correlation times, the samples show the mean and deviation asked for."""
    wind = Wind((3.0, -1.0, 0.0), 0.8, "a", STEP)
    east = []
    for _ in range(150_000):
        wind.step()
        east.append(wind.velocity[0])
    assert statistics.fmean(east) == pytest.approx(3.0, abs=0.15)
    assert statistics.pstdev(east) == pytest.approx(0.8, rel=0.12)


def test_no_noise_reads_the_truth() -> None:
    """A scale of 0 gives the exact state and the exact fix."""
    noise = SensorNoise(0.0, "a")
    for _ in range(100):
        noise.update()
    odometry = noise.odometry(MOTION)
    assert tuple(odometry.position) == MOTION.position
    assert (odometry.yaw, odometry.roll, odometry.pitch) == (1.2, 0.02, -0.01)
    assert odometry.position_sigma == 0.0
    origin = GeodeticOrigin(12.97, 77.59, 920.0)
    fix = noise.gps(MOTION, origin)
    local = origin.to_local(fix.latitude, fix.longitude, fix.altitude)
    assert local == pytest.approx(np.array(MOTION.position), abs=1e-6)


def test_noise_scales_and_follows_the_seed() -> None:
    """The error grows with the scale; one seed gives one error, another gives another."""

    def error(scale: float, seed: str) -> float:
        noise = SensorNoise(scale, seed)
        total = 0.0
        for _ in range(400):
            noise.update()
            total += float(np.linalg.norm(noise.odometry(MOTION).position - MOTION.position))
        return total / 400

    assert error(1.0, "a") == error(1.0, "a")
    assert error(1.0, "a") != error(1.0, "b")
    assert error(3.0, "a") == pytest.approx(3 * error(1.0, "a"), rel=1e-6)
    assert 0.005 < error(1.0, "a") < 0.3

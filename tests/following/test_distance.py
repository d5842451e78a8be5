"""The distance flown: what the drone flew, not what its odometry trembled."""

from __future__ import annotations

import numpy as np
from flights import KinematicVehicle, add, flight, length, square

from aerodaas.messages.odometry import Odometry
from aerodaas.messages.vehicle import VehicleState


class TremblingVehicle(KinematicVehicle):
    """Believes to be some centimetres from where it is, somewhere else each time."""

    def __init__(self, sigma: float) -> None:
        super().__init__()
        self._sigma = sigma
        self._draw = np.random.default_rng(3)

    def read(self) -> VehicleState:
        """Return the state as believed."""
        state = super().read()
        odometry = state.odometry
        noisy = odometry.position + self._draw.normal(0.0, self._sigma, 3)
        object.__setattr__(state, "odometry", Odometry(noisy, odometry.velocity, odometry.yaw))
        return state


def test_noise_of_the_odometry_is_no_distance() -> None:
    """A survey of some 45 m with 40 s of hover counts as such for all that the odometry noises."""
    survey = flight(add(*square(hover=10.0)), vehicle=TremblingVehicle(0.03))
    survey.run()
    flown = length(survey.track)
    assert 40.0 < flown < 60.0
    assert abs(survey.status.distance / flown - 1.0) < 0.05

"""Constant-velocity Kalman filter of one box: centre, width and height.

The four numbers of a box are independent, so four filters of two states (value and velocity) run
in parallel as arrays, in closed form. As in SORT and DeepSORT (Bewley et al. 2016, Wojke et al.
2017) all noise is proportional to the box's height, because near objects move faster in the
image; unlike there, time is in seconds, not in frames.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import Box

__all__ = ["BoxFilter"]

Array = NDArray[np.float64]
_MEASUREMENT = 0.08
"""Standard deviation of a detected box, in box heights."""
_FIRST_VELOCITY = 1.0
"""Standard deviation of an unknown velocity, in box heights a second."""
_ACCELERATION = 1.5
"""Standard deviation of the acceleration, in box heights a second squared."""
_SMALLEST = 1.0


class BoxFilter:
    """Estimate of one box, with its covariance."""

    def __init__(self, box: Box) -> None:
        """Initialise at a detected `box` (left, top, right, bottom in pixels), at rest."""
        self.value: Array = _measurement(box)
        self.velocity: Array = np.zeros(4)
        scale = self._scale
        self._variance: Array = np.full(4, (_MEASUREMENT * scale) ** 2)
        self._covariance: Array = np.zeros(4)
        self._velocity_variance: Array = np.full(4, (_FIRST_VELOCITY * scale) ** 2)

    @property
    def box(self) -> Box:
        """Left, top, right, bottom, in pixels."""
        u, v, width, height = self.value.tolist()
        width, height = max(width, _SMALLEST), max(height, _SMALLEST)
        return u - width / 2, v - height / 2, u + width / 2, v + height / 2

    def predict(self, dt: float) -> None:
        """Advance by `dt` seconds, with white noise of acceleration."""
        noise = (_ACCELERATION * self._scale) ** 2
        self.value = self.value + dt * self.velocity
        self._variance = (
            self._variance
            + 2 * dt * self._covariance
            + dt**2 * self._velocity_variance
            + noise * dt**4 / 4
        )
        self._covariance = self._covariance + dt * self._velocity_variance + noise * dt**3 / 2
        self._velocity_variance = self._velocity_variance + noise * dt**2

    def shift(self, u: float, v: float) -> None:
        """Move the estimate by pixels, as the camera has turned."""
        self.value = self.value + np.array([u, v, 0.0, 0.0])

    def distance(self, box: Box) -> tuple[float, float]:
        """Squared Mahalanobis distance of a detected `box`, and log determinant of the covariance.

        The covariance is that of the innovation.
        """
        spread = self._variance + (_MEASUREMENT * self._scale) ** 2
        innovation = _measurement(box) - self.value
        return float(np.sum(innovation**2 / spread)), float(np.sum(np.log(spread)))

    def update(self, box: Box) -> None:
        """Correct the estimate by a detected `box`."""
        spread = self._variance + (_MEASUREMENT * self._scale) ** 2
        innovation = _measurement(box) - self.value
        gain, velocity_gain = self._variance / spread, self._covariance / spread
        self.value = self.value + gain * innovation
        self.velocity = self.velocity + velocity_gain * innovation
        self._velocity_variance = self._velocity_variance - velocity_gain * self._covariance
        self._covariance = (1 - gain) * self._covariance
        self._variance = (1 - gain) * self._variance

    @property
    def _scale(self) -> float:
        return max(float(self.value[3]), _SMALLEST)


def _measurement(box: Box) -> Array:
    left, top, right, bottom = box
    return np.array([(left + right) / 2, (top + bottom) / 2, right - left, bottom - top])

"""People and cars that stand elsewhere, people in another posture, at each full second."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.skeleton import JOINTS, Posture, joints
from aerodaas.simulation.world import State, Thing

__all__ = ["ParkedCar", "Passer"]

_RAISED, _WAVING, _FALLEN, _BENT = 0.25, 0.4, 0.2, 0.15
"""Shares of the postures: a hand raised, arms anywhere, lying, legs bent."""


@dataclass(frozen=True)
class _Scattered(Thing):
    """A thing whose place is drawn anew for each full second."""

    around: tuple[float, float] = (0.0, 0.0)
    """Middle of the places, ENU metres."""
    radius: float = 8.0
    """Metres from it, at most."""

    def _drawn(self, time: float) -> tuple[random.Random, float, float, float]:
        """Generator of this second, and x, y, yaw."""
        draw = random.Random(f"{self.seed}/{int(time)}")
        reach, angle = self.radius * math.sqrt(draw.random()), draw.uniform(-math.pi, math.pi)
        x = self.around[0] + reach * math.cos(angle)
        y = self.around[1] + reach * math.sin(angle)
        return draw, x, y, draw.uniform(-math.pi, math.pi)


class ParkedCar(_Scattered):
    """A car."""

    def state(self, time: float) -> State:
        """Stand somewhere."""
        _, x, y, yaw = self._drawn(time)
        return State(x, y, yaw)


class Passer(_Scattered):
    """A person."""

    def state(self, time: float) -> State:
        """Stand, walk or lie somewhere."""
        draw, x, y, yaw = self._drawn(time)
        return State(x, y, yaw, posture=_posture(draw))

    def joints(self, time: float) -> NDArray[np.float64]:
        """Joints of the skeleton's gaits and gestures, and of many more postures."""
        state = self.state(time)
        draw = random.Random(f"{self.seed}/{int(time)}/limbs")
        body = joints(self.height, state.posture)
        if state.posture.fallen:
            # Some lie on their backs or sides.
            middle = body[0] * (1.0, 1.0, 1.6)
            roll = draw.choice([0.0, math.pi, draw.uniform(-math.pi, math.pi)])
            body = (body - middle) @ rotation_from_rpy(roll, 0.0, 0.0).T + middle
            body[:, 2] += max(0.0, 0.06 - float(body[:, 2].min()))
        else:
            _place_arms(body, draw)
            _place_legs(body, draw)
            lean = rotation_from_rpy(draw.gauss(0, 0.06), draw.gauss(0.03, 0.1), 0.0)
            body = body @ lean.T
            body[:, 2] += 0.08 - float(body[:, 2].min())
        c, s = math.cos(state.yaw), math.sin(state.yaw)
        turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(body @ turn + np.array([state.x, state.y, 0.0]))


def _posture(draw: random.Random) -> Posture:
    raised = draw.uniform(0.6, 1.0) if draw.random() < _RAISED else 0.0
    fallen = 1.0 if draw.random() < _FALLEN else 0.0
    stepping = draw.choice([0.0, draw.uniform(0.3, 1.0)])
    return Posture(draw.uniform(0.0, 10.0), stepping, 0.0 if fallen else raised, fallen)


def _place_arms(body: NDArray[np.float64], draw: random.Random) -> None:
    for side, sign in (("left", 1.0), ("right", -1.0)):
        if draw.random() >= _WAVING:
            continue
        shoulder, elbow, wrist = (
            JOINTS.index(f"{side}_{joint}") for joint in ("shoulder", "elbow", "wrist")
        )
        upper = np.linalg.norm(body[elbow] - body[shoulder])
        lower = np.linalg.norm(body[wrist] - body[elbow])
        ahead, up = draw.uniform(-0.3, 1.0), draw.uniform(-1.0, 1.0)
        along = np.array([ahead, sign * draw.uniform(-0.1, 1.0), up])
        along /= np.linalg.norm(along)
        bent = along + np.array([draw.uniform(0, 0.9), -sign * draw.uniform(-0.3, 0.9), 0.0])
        bent[2] += draw.uniform(-0.9, 0.9)
        bent /= np.linalg.norm(bent)
        body[elbow] = body[shoulder] + upper * along
        body[wrist] = body[elbow] + lower * bent


def _place_legs(body: NDArray[np.float64], draw: random.Random) -> None:
    """Bend both legs as in crouching or sitting; the feet stay below."""
    if draw.random() >= _BENT:
        return
    thigh, shin = draw.uniform(0.2, 1.6), draw.uniform(-0.9, 0.2)
    for side in ("left", "right"):
        hip, knee, ankle, toe = (
            JOINTS.index(f"{side}_{joint}") for joint in ("hip", "knee", "ankle", "toe")
        )
        upper = np.linalg.norm(body[knee] - body[hip])
        lower = np.linalg.norm(body[ankle] - body[knee])
        foot = np.linalg.norm(body[toe] - body[ankle])
        body[knee] = body[hip] + upper * np.array([math.sin(thigh), 0, -math.cos(thigh)])
        body[ankle] = body[knee] + lower * np.array([math.sin(shin), 0, -math.cos(shin)])
        body[toe] = body[ankle] + foot * np.array([1.0, 0.0, -0.1])

"""Bodies in random postures: the simulator's skeleton with its limbs and trunk moved at random."""

# The figures are shares of a mixture of postures, each said where it is drawn.
# ruff: noqa: PLR2004

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import rotation_from_rpy
from aerodaas.simulation.skeleton import JOINTS, KEYPOINTS, Posture, joints

__all__ = ["keypoints_of", "sample_body"]

Array = NDArray[np.float64]
Generator = np.random.Generator
_J = {name: index for index, name in enumerate(JOINTS)}
_SIDES = (("left", 1.0), ("right", -1.0))
_LEGS = [
    index
    for name, index in _J.items()
    if name.partition("_")[2] in {"hip", "knee", "ankle", "toe"} or name == "pelvis"
]
_UPPER = [index for index in _J.values() if index not in _LEGS]
_RAISED, _LOWERED = 0.10, 0.05
"""Metres above the nose at which a hand is raised; above the shoulder, up to which it is not."""


def sample_body(rng: Generator, gesture: str) -> Array:
    """Draw a body (len(JOINTS), 3) in metres that shows `gesture`, one of `GESTURES`."""
    while True:
        height = float(rng.uniform(1.5, 1.95))
        walk = Posture(float(rng.uniform(0, 2)), float(rng.choice([0.0, rng.uniform(0, 1)])))
        body = joints(height, walk)
        raised = gesture == "hand_raised" or (gesture == "fallen" and rng.random() < 0.15)
        _move_arms(body, rng, raised=raised)
        if gesture == "other":
            _sit_or_bend(body, rng)
        if gesture == "fallen":
            return _fall(body, rng)
        lift = _highest_hand(body) * 1.75 / height
        if gesture == "hand_raised" and lift >= _RAISED:
            return body
        near_head = _hand_above_shoulder(body) > _LOWERED
        if gesture == "upright" and not near_head:
            return body
        if gesture == "other":
            return body


def keypoints_of(body: Array) -> Array:
    """The 17 keypoints (17, 3) of a body, in COCO's order."""
    return body[list(KEYPOINTS)]


def _direction(forward: float, out: float, sign: float) -> Array:
    """Unit vector of a limb turned forward and outwards from hanging, in radians."""
    flat = math.cos(out)
    return np.array([math.sin(forward) * flat, sign * math.sin(out), -math.cos(forward) * flat])


def _set_limb(body: Array, names: tuple[str, str, str], first: Array, second: Array) -> None:
    start, middle, end = (_J[name] for name in names)
    upper = float(np.linalg.norm(body[middle] - body[start]))
    lower = float(np.linalg.norm(body[end] - body[middle]))
    body[middle] = body[start] + upper * first
    body[end] = body[middle] + lower * second


def _move_arms(body: Array, rng: Generator, *, raised: bool) -> None:
    up = {"left", "right"} if rng.random() < 0.15 else {str(rng.choice(["left", "right"]))}
    for side, sign in _SIDES:
        if raised and side in up:
            first, second = _raised_arm(rng, sign)
        elif rng.random() < 0.2:
            first, second = _arm_held_out(rng, sign)
        else:
            swing, out = rng.normal(0, 0.3), rng.uniform(0, 0.35)
            bend = rng.uniform(0, 0.5) if rng.random() < 0.6 else rng.uniform(0.5, 2.1)
            first = _direction(swing, out, sign)
            second = _direction(swing + bend, rng.uniform(-0.5, 0.3), sign)
        _set_limb(body, (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"), first, second)


def _raised_arm(rng: Generator, sign: float) -> tuple[Array, Array]:
    if rng.random() < 0.25:
        # The upper arm out, the forearm up: a wave.
        out = _direction(rng.uniform(0.2, 1.4), rng.uniform(1.1, 1.6), sign)
        return out, _direction(math.pi + rng.normal(0, 0.2), rng.normal(0, 0.3), sign)
    turn = rng.uniform(2.1, 3.4)
    first = _direction(turn, rng.uniform(-0.2, 0.5), sign)
    return first, _direction(turn + rng.normal(0.1, 0.25), rng.normal(0, 0.3), sign)


def _arm_held_out(rng: Generator, sign: float) -> tuple[Array, Array]:
    forward, out = rng.uniform(0.3, 1.5), rng.uniform(-0.2, 1.4)
    first = _direction(forward, out, sign)
    return first, _direction(forward + rng.normal(0, 0.3), out + rng.normal(0, 0.2), sign)


def _highest_hand(body: Array) -> float:
    """Metres of the higher wrist above the nose."""
    wrists = body[[_J["left_wrist"], _J["right_wrist"]], 2]
    return float(wrists.max() - body[_J["nose"], 2])


def _hand_above_shoulder(body: Array) -> float:
    wrists = body[[_J["left_wrist"], _J["right_wrist"]], 2]
    return float(wrists.max() - body[_J["left_shoulder"], 2])


def _sit_or_bend(body: Array, rng: Generator) -> None:
    kind = rng.choice(["sit", "crouch", "bend", "hand at head"])
    if kind == "hand at head":
        side, sign = _SIDES[rng.integers(2)]
        first = _direction(rng.uniform(0.9, 2.0), rng.uniform(0.3, 1.0), sign)
        head = body[_J["head"]] + rng.normal(0, 0.06, 3)
        elbow = body[_J[f"{side}_shoulder"]] + 0.3 * first
        towards = head - elbow
        second = towards / max(float(np.linalg.norm(towards)), 1e-6)
        _set_limb(body, (f"{side}_shoulder", f"{side}_elbow", f"{side}_wrist"), first, second)
        return
    if kind == "bend":
        _lean(body, rng.uniform(0.8, 1.7))
        return
    for side, sign in _SIDES:
        thigh = rng.uniform(1.2, 1.8) if kind == "sit" else rng.uniform(1.6, 2.3)
        shin = thigh - rng.uniform(0.1, 1.8) if kind == "sit" else thigh - rng.uniform(2.0, 2.6)
        spread = rng.uniform(-0.1, 0.5)
        names = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
        _set_limb(body, names, _direction(thigh, spread, sign), _direction(shin, 0.0, sign))
        body[_J[f"{side}_toe"]] = body[_J[f"{side}_ankle"]] + [0.15, 0.0, -0.02]
    _lean(body, rng.uniform(-0.2, 0.7))
    body[:, 2] += 0.08 - body[:, 2].min()


def _lean(body: Array, angle: float) -> None:
    pelvis = body[_J["pelvis"]].copy()
    turn = rotation_from_rpy(0.0, angle, 0.0)
    body[_UPPER] = (body[_UPPER] - pelvis) @ turn.T + pelvis


def _fall(body: Array, rng: Generator) -> Array:
    """Lay the body down on its back, front or side, its legs drawn up at random."""
    for side, sign in _SIDES:
        thigh, bend = rng.normal(0.3, 0.5), abs(rng.normal(0, 0.7))
        names = (f"{side}_hip", f"{side}_knee", f"{side}_ankle")
        first = _direction(thigh, rng.uniform(-0.1, 0.4), sign)
        _set_limb(body, names, first, _direction(thigh - bend, 0.0, sign))
    _lean(body, rng.normal(0.0, 0.3))
    body -= body[_J["pelvis"]]
    about_itself = rotation_from_rpy(0.0, 0.0, rng.uniform(-math.pi, math.pi))
    down = rotation_from_rpy(0.0, math.pi / 2 + rng.normal(0, 0.2), 0.0)
    body = body @ about_itself.T @ down.T
    # The limbs lie on the ground, too.
    body[:, 2] *= 0.6
    body[:, 2] += 0.08 - body[:, 2].min()
    return body

"""Kinematic model of the human body: joint positions when standing, walking, gesturing or lying.

The renderer draws limbs between these joints and the labels are derived from them, so that both
agree exactly. Coordinates are metres in the person's own reference frame: x forward, y left,
z up, with the feet on the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry.frames import rotation_from_rpy

__all__ = ["JOINTS", "KEYPOINTS", "LIMBS", "Posture", "joints"]

_Point: TypeAlias = tuple[float, float, float]

JOINTS = (
    "pelvis",
    "neck",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "left_hip",
    "right_hip",
    "left_knee",
    "right_knee",
    "left_ankle",
    "right_ankle",
    "left_toe",
    "right_toe",
    "nose",
    "left_eye",
    "right_eye",
    "left_ear",
    "right_ear",
)
"""Order of the rows that `joints` returns."""

KEYPOINTS = tuple(
    JOINTS.index(name)
    for name in (
        "nose",
        "left_eye",
        "right_eye",
        "left_ear",
        "right_ear",
        "left_shoulder",
        "right_shoulder",
        "left_elbow",
        "right_elbow",
        "left_wrist",
        "right_wrist",
        "left_hip",
        "right_hip",
        "left_knee",
        "right_knee",
        "left_ankle",
        "right_ankle",
    )
)
"""Rows of the 17 COCO keypoints, in COCO's order."""

LIMBS = tuple(
    (f"{side}_{upper}", f"{side}_{lower}")
    for side in ("left", "right")
    for upper, lower in (
        ("shoulder", "elbow"),
        ("elbow", "wrist"),
        ("hip", "knee"),
        ("knee", "ankle"),
        ("ankle", "toe"),
    )
)
"""Pairs of joints connected by a limb."""

_REFERENCE_HEIGHT = 1.75
"""Height in metres of an average adult with the proportions below (Drillis and Contini, 1966)."""

_THIGH, _SHIN, _FOOT, _ANKLE = 0.43, 0.43, 0.19, 0.08
_UPPER_ARM, _FOREARM = 0.30, 0.30
_HIP_HALF, _SHOULDER_HALF = 0.10, 0.20
_TORSO, _SHOULDER_DROP, _HEAD = 0.56, 0.05, 0.17
_STRIDE = 1.35
"""Length of two steps, metres."""

_FOOT_ANGLE = 1.32
"""Angle between shin and foot in radians, with the toes slightly down."""

_LYING = 0.14
"""Height of the pelvis above the ground when lying, metres."""


@dataclass(frozen=True, slots=True)
class Posture:
    """Posture of the body at one time."""

    travelled: float = 0.0
    """Distance walked in metres, which determines the phase of the gait."""
    stepping: float = 0.0
    """Swing of the legs, 0 (standing) to 1 (walking briskly)."""
    raised: float = 0.0
    """Elevation of the right hand, 0 to 1."""
    fallen: float = 0.0
    """Progress of a fall, 0 to 1."""
    forward: bool = False
    """Whether the fall is on the face instead of on the back."""


def joints(height: float, posture: Posture) -> NDArray[np.float64]:
    """Positions of a person's joints, metres, (len(JOINTS), 3).

    Args:
        height: Height of the person, metres.
        posture: Gait, gesture and fall at this time.
    """
    phase = math.tau * posture.travelled / _STRIDE
    stepping = posture.stepping * (1.0 - posture.fallen)
    neck = (0.03 * stepping, 0.0, _TORSO)
    head = (neck[0] + 0.02, 0.0, _TORSO + _HEAD - 0.02)
    place: dict[str, _Point] = {"pelvis": (0.0, 0.0, 0.0), "neck": neck, "head": head}
    place["nose"] = (head[0] + 0.11, 0.0, head[2] - 0.01)
    for side, sign, offset in (("left", 1.0, 0.0), ("right", -1.0, math.pi)):
        swing = math.sin(phase + offset) * stepping
        lift = max(0.0, math.cos(phase + offset)) * stepping
        _leg(place, side, sign, swing, lift)
        _arm(place, side, sign, swing, posture.raised if side == "right" else 0.0)
        place[f"{side}_eye"] = (head[0] + 0.09, sign * 0.035, head[2] + 0.025)
        place[f"{side}_ear"] = (head[0], sign * 0.085, head[2])
    body = np.array([place[name] for name in JOINTS])
    body[:, 2] += _ANKLE - min(place["left_ankle"][2], place["right_ankle"][2])
    if posture.fallen > 0.0:
        angle = posture.fallen * math.pi / 2 * (1.0 if posture.forward else -1.0)
        body = body @ rotation_from_rpy(0.0, angle, 0.0).T
        body[:, 2] += _LYING * posture.fallen
    return np.asarray(body * (height / _REFERENCE_HEIGHT))


def _leg(place: dict[str, _Point], side: str, sign: float, swing: float, lift: float) -> None:
    bend = 0.08 + 0.85 * lift
    thigh = 0.42 * swing + 0.5 * bend * lift
    shin = thigh - bend
    hip = (0.0, sign * _HIP_HALF, 0.0)
    knee = _from(hip, thigh, _THIGH)
    ankle = _from(knee, shin, _SHIN)
    place[f"{side}_hip"], place[f"{side}_knee"], place[f"{side}_ankle"] = hip, knee, ankle
    place[f"{side}_toe"] = _from(ankle, shin + _FOOT_ANGLE, _FOOT)


def _arm(place: dict[str, _Point], side: str, sign: float, swing: float, raised: float) -> None:
    neck = place["neck"]
    shoulder = (neck[0], sign * _SHOULDER_HALF, neck[2] - _SHOULDER_DROP)
    hanging, forearm = -0.5 * swing, -0.5 * swing + 0.35
    out, turn = sign * (0.12 + 0.1 * raised), raised * (math.pi - 0.15)
    elbow = _from(shoulder, hanging * (1 - raised) + turn, _UPPER_ARM, out)
    place[f"{side}_shoulder"], place[f"{side}_elbow"] = shoulder, elbow
    place[f"{side}_wrist"] = _from(elbow, forearm * (1 - raised) + turn, _FOREARM, 0.5 * out)


def _from(start: _Point, angle: float, length: float, out: float = 0.0) -> _Point:
    """End of a limb hanging from `start`, rotated forward by `angle` and sideways by `out`."""
    reach = length / math.sqrt(1.0 + out * out)
    return (
        start[0] + reach * math.sin(angle),
        start[1] + reach * out,
        start[2] - reach * math.cos(angle),
    )

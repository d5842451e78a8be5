"""The human body: where its joints are while it stands, walks, raises a hand or lies fallen.

The renderer draws limbs between these joints and the labels are taken from them, so that both
agree exactly. Coordinates are metres in the person's own frame: x forward, y left, z up, with
the feet on the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodaas.geometry import rotation_from_rpy

__all__ = ["JOINTS", "KEYPOINTS", "LIMBS", "Posture", "joints"]

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
"""Pairs of joints that a limb joins."""

_REFERENCE_HEIGHT = 1.75
"""Metres; the proportions below are those of an average adult (Drillis and Contini, 1966)."""

_THIGH, _SHIN, _FOOT, _ANKLE = 0.43, 0.43, 0.19, 0.08
_UPPER_ARM, _FOREARM = 0.30, 0.30
_HIP_HALF, _SHOULDER_HALF = 0.10, 0.20
_TORSO, _SHOULDER_DROP, _HEAD = 0.56, 0.05, 0.17
_STRIDE = 1.35
"""Metres of two steps."""

_LYING = 0.14
"""Height of the pelvis above the ground when lying."""


@dataclass(frozen=True, slots=True)
class Posture:
    """What the body does at a moment."""

    travelled: float = 0.0
    """Metres walked, which sets the phase of the gait."""
    stepping: float = 0.0
    """How much the legs swing, 0 (standing) to 1 (walking briskly)."""
    raised: float = 0.0
    """How far the right hand is raised, 0 to 1."""
    fallen: float = 0.0
    """How far the body has fallen over, 0 to 1."""


def joints(height: float, posture: Posture) -> NDArray[np.float64]:
    """Positions (len(JOINTS), 3) of the joints of a person of `height` metres."""
    phase = math.tau * posture.travelled / _STRIDE
    place: dict[str, NDArray[np.float64]] = {"pelvis": np.zeros(3)}
    place["neck"] = np.array([0.03 * posture.stepping, 0.0, _TORSO])
    for side, sign, offset in (("left", 1.0, 0.0), ("right", -1.0, math.pi)):
        swing = math.sin(phase + offset) * posture.stepping
        lift = max(0.0, math.cos(phase + offset)) * posture.stepping
        _leg(place, side, sign, swing, lift)
        _arm(place, side, sign, swing, posture.raised if side == "right" else 0.0)
    head = place["neck"] + np.array([0.02, 0.0, _HEAD - 0.02])
    place["head"] = head
    place["nose"] = head + np.array([0.11, 0.0, -0.01])
    for side, sign in (("left", 1.0), ("right", -1.0)):
        place[f"{side}_eye"] = head + np.array([0.09, sign * 0.035, 0.025])
        place[f"{side}_ear"] = head + np.array([0.0, sign * 0.085, 0.0])
    body = np.array([place[name] for name in JOINTS])
    body[:, 2] += _ANKLE - min(place["left_ankle"][2], place["right_ankle"][2])
    if posture.fallen > 0.0:
        angle = -posture.fallen * math.pi / 2
        body = body @ rotation_from_rpy(0.0, angle, 0.0).T
        body[:, 2] += _LYING * posture.fallen
    return np.asarray(body * (height / _REFERENCE_HEIGHT))


def _leg(
    place: dict[str, NDArray[np.float64]], side: str, sign: float, swing: float, lift: float
) -> None:
    thigh, knee = 0.42 * swing, 0.08 + 0.85 * lift
    hip = np.array([0.0, sign * _HIP_HALF, 0.0])
    place[f"{side}_hip"] = hip
    place[f"{side}_knee"] = hip + _swung(thigh + 0.5 * knee * lift, _THIGH)
    shin = thigh + 0.5 * knee * lift - knee
    place[f"{side}_ankle"] = place[f"{side}_knee"] + _swung(shin, _SHIN)
    toe = np.array([math.cos(shin), 0.0, math.sin(shin) - 0.25])
    place[f"{side}_toe"] = place[f"{side}_ankle"] + _FOOT * toe / np.linalg.norm(toe)


def _arm(
    place: dict[str, NDArray[np.float64]], side: str, sign: float, swing: float, raised: float
) -> None:
    shoulder = place["neck"] + np.array([0.0, sign * _SHOULDER_HALF, -_SHOULDER_DROP])
    place[f"{side}_shoulder"] = shoulder
    hanging, forearm = -0.5 * swing, -0.5 * swing + 0.35
    out = sign * (0.12 + 0.1 * raised)
    turn = raised * (math.pi - 0.15)
    place[f"{side}_elbow"] = shoulder + _swung(hanging * (1 - raised) + turn, _UPPER_ARM, out)
    place[f"{side}_wrist"] = place[f"{side}_elbow"] + _swung(
        forearm * (1 - raised) + turn, _FOREARM, 0.5 * out
    )


def _swung(angle: float, length: float, out: float = 0.0) -> NDArray[np.float64]:
    """Return a vector that hangs down, turned forward by `angle` and sideways by `out`."""
    down = np.array([math.sin(angle), out, -math.cos(angle)])
    return np.asarray(length * down / np.linalg.norm(down))

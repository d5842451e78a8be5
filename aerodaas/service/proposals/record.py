"""What the database keeps of a proposal: its hash, when it lapses, and its envelope."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import shapely
from pydantic import BaseModel, ConfigDict, Field

from aerodaas.clock import WallOffset
from aerodaas.dataflow.mission_document import (
    MissionDocument,
)
from aerodaas.messages.mission import Place
from aerodaas.protocol.proposals import ApprovalOut, Envelope

__all__ = [
    "APPROVAL_SECONDS",
    "CHARGE_POINTS",
    "VERDICT_SECONDS",
    "Conditions",
    "ProposalRecord",
    "encloses",
    "envelope_violation",
    "lapse_reason",
    "plain_text",
    "proposal_hash",
]

APPROVAL_SECONDS = 600.0
"""For a take-off after its approval: whoever approved has the place before their eyes so long."""
VERDICT_SECONDS = 1800.0
"""For an approval after the rehearsal: time to call a person, in which weather hardly changes."""
CHARGE_POINTS = 0.03
"""Share of a full charge that a drone may lose after its rehearsal: minutes of standing ready."""
_WIND_MARGIN = 1.0
"""m/s by which the wind may exceed what was rehearsed: an anemometer's error."""
_ROUNDING = 1e-9


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Conditions(_Record):
    """Conditions for which a rehearsal is good: charge, wind and limits, at one moment."""

    at: float
    """Unix seconds."""
    offset: WallOffset
    """Of the wall clock by which `at` and the approval's moment are meant."""
    battery: dict[str, float] = Field(default_factory=dict)
    """Charge by robot, 0 to 1."""
    wind: float = 0.0
    """m/s: the larger of the environment's with its gusts, and of the newest reported."""
    limits: dict[str, Any] = Field(default_factory=dict)
    """The flight's limits by robot, and the wind of the environment."""


class ProposalRecord(_Record):
    """Record of a proposal in the database, beside its document and its verdict."""

    conditions: Conditions
    """Of its newest rehearsal; before the first, of the moment when it was proposed."""
    parent: str | None = None
    change_of: str | None = None
    why: str = ""
    difference: list[str] = Field(default_factory=list)
    seeds: int = 1
    """Flights of its newest rehearsal."""
    approval: ApprovalOut | None = None
    """None also for one that has lapsed."""


def proposal_hash(
    document: MissionDocument,
    record: ProposalRecord,
    minutes: float,
    verdict: Mapping[str, Any] | None,
) -> str:
    """SHA-256, hexadecimal, of all that an approval is bound to.

    Args:
        document: The mission document.
        record: Its conditions, with the limits and the moment of the rehearsal.
        minutes: Of the lease, which has the whole fence for its area.
        verdict: The rehearsal's; None before it.
    """
    content = {
        "document": document.model_dump(mode="json"),
        "conditions": record.conditions.model_dump(mode="json"),
        "lease": {"minutes": minutes, "area": None},
        "verdict": verdict,
        "change_of": record.change_of,
    }
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def lapse_reason(rehearsed: Conditions, present: Conditions, spare: float = CHARGE_POINTS) -> str:
    """Why a rehearsal says nothing of a flight any more; empty if it still does.

    Args:
        rehearsed: Conditions of the rehearsal.
        present: Conditions now; without limits where these were not looked at.
        spare: Share of a full charge that each robot may have lost since.
    """
    for robot, charge in rehearsed.battery.items():
        now = present.battery.get(robot, charge)
        if charge - now > spare + _ROUNDING:
            return f"{robot} holds {now:.0%}, and was rehearsed with {charge:.0%}"
    if present.wind > rehearsed.wind + _WIND_MARGIN:
        return f"the wind is {present.wind:.1f} m/s, and was rehearsed up to {rehearsed.wind:.1f}"
    if present.limits and present.limits != rehearsed.limits:
        names = rehearsed.limits.keys() | present.limits.keys()
        changed = [
            name for name in sorted(names) if rehearsed.limits.get(name) != present.limits.get(name)
        ]
        return f"limits have changed since: {', '.join(changed)}"
    return ""


def encloses(area: Sequence[tuple[float, float]]) -> bool:
    """Whether corners in this order enclose an area."""
    polygon = shapely.Polygon(area)
    return polygon.is_valid and polygon.area > 0.0


def envelope_violation(envelope: Envelope, places: Sequence[Place], minutes: float) -> str:
    """Reason for which a way lies outside an envelope; empty if it lies inside.

    Args:
        envelope: Bounds that were approved.
        places: Where the robot is and its waypoints, which it flies to on straight legs.
        minutes: From its take-off to its landing.
    """
    way = shapely.LineString([(east, north) for east, north, _ in places])
    if not shapely.Polygon(envelope.area).covers(way):
        return "a leg leaves the approved area"
    heights = [up for _, _, up in places]
    if min(heights) < envelope.floor:
        return f"it flies {min(heights):.1f} m high, and {envelope.floor:g} m are the least"
    if max(heights) > envelope.ceiling:
        return f"it flies {max(heights):.1f} m high, and {envelope.ceiling:g} m are the most"
    if not minutes <= envelope.minutes:
        return f"it lands after {minutes:.1f} min, and {envelope.minutes:g} min were approved"
    return ""


def plain_text(text: str) -> str:
    """A stranger's text on one line, whose controls and formats are replaced."""
    return "".join(one if one.isprintable() else " " for one in text).strip()

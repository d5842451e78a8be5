"""Missions that are proposed, checked, rehearsed and approved before they fly: JSON models.

A program that may not fly, such as an agent, proposes a mission. It is checked without flying, then
rehearsed in simulation. An account that is no agent's approves exactly that, by its hash.

Units are metres, seconds, radians and m/s; a charge is 0 to 1; places are east, north and up of
home.
"""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from pydantic import FailFast, Field

from aerodaas.dataflow.mission_document import DocumentWaypoint, MissionDocument
from aerodaas.identifiers import Word
from aerodaas.protocol.base import AnswerModel, Area, Minutes, Number, Positive, RequestModel

__all__ = [
    "ApprovalIn",
    "ApprovalOut",
    "ChangeIn",
    "CheckName",
    "CheckReport",
    "ClearanceOut",
    "Envelope",
    "Finding",
    "ProposalIn",
    "ProposalOut",
    "RefusedCallIn",
    "RehearseIn",
    "RobotForecast",
]

_MOST_SEEDS = 5
_LONGEST_REASON = 500


class ProposalIn(RequestModel):
    """A mission that is kept and checked; nothing flies by it."""

    document: MissionDocument
    minutes: Minutes = 15.0
    """Of the lease that is requested with it."""
    parent: str | None = None
    """Id of the proposal that it changes; None for a new one."""
    why: Annotated[str, Field(max_length=_LONGEST_REASON)] = ""
    """Reason in the proposer's words, shown to the approver as text that nobody has checked."""


class RehearseIn(RequestModel):
    """Request of a rehearsal in simulation."""

    seeds: Annotated[int, Field(ge=1, le=_MOST_SEEDS)] = 3
    """Flights in simulation, each with another seed of gusts and noise."""


CheckName: TypeAlias = Literal[
    "fence",
    "ceiling",
    "floor",
    "range",
    "no_fly",
    "ground",
    "clearance",
    "follow_distance",
    "speed",
    "battery",
    "lease",
    "deadline",
    "unknown_name",
    "document",
]
"""Check of a document without flying, by the limit that it looks at."""


class Finding(AnswerModel):
    """One reason against a mission document."""

    check: CheckName
    text: str
    """What is wrong, with its figures."""
    remedy: str
    """What a better document would do."""
    robot: str | None = None
    waypoint: str | None = None
    place: tuple[float, float, float] | None = None
    measured: float | None = None
    """In the unit of the limit."""
    limit: float | None = None
    unit: str = ""
    """`m`, `s`, `m/s` or `%`."""


class RobotForecast(AnswerModel):
    """Way of one robot, as planned from its present place and charge."""

    robot: str
    waypoints: int = 0
    distance: float | None = None
    """Metres, the way home included; None where an analysis decides the way."""
    seconds: float | None = None
    battery: float | None = None
    """Charge at the start."""
    battery_used: float | None = None
    highest: float | None = None
    """Metres above home of the highest waypoint."""


class CheckReport(AnswerModel):
    """Result of `aerodaas.documents.checking.check_document`: checks without flying."""

    passed: bool
    findings: list[Finding] = Field(default_factory=list)
    forecasts: list[RobotForecast] = Field(default_factory=list)


class ClearanceOut(AnswerModel):
    """Smallest distance of a rehearsed flight from an object of the simulated world."""

    distance: float
    """Metres from the drone's centre to the object; 0 for a collision."""
    thing: str
    """Id of the object."""
    label: str
    """Its kind, such as `building`, `tree` or `person`."""
    robot: str
    place: tuple[float, float, float]
    time: float
    """Mission time, seconds."""


class Envelope(RequestModel):
    """Bounds within which an approved mission may be changed in flight without a new approval."""

    area: Area
    """Corners (east, north)."""
    floor: Number = 0.0
    """Lowest height above home."""
    ceiling: Positive
    """Greatest height above home."""
    minutes: Minutes
    """From the take-off on."""


class ApprovalIn(RequestModel):
    """Approval of exactly one proposal."""

    hash: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    """`ProposalOut.hash`, as the approver was shown it."""
    envelope: Envelope | None = None
    """Changes in flight that need no new approval; None for none."""
    actuators: list[str] = Field(default_factory=list, max_length=64)
    """Actuators that the mission may move, as `robot/actuator`."""


class ApprovalOut(AnswerModel):
    """Approval of a proposal."""

    account: str
    """Approver."""
    at: float
    lapses: float
    """Moment (Unix seconds) from which on it is no longer good for a take-off."""
    hash: str
    envelope: Envelope | None = None
    actuators: list[str] = Field(default_factory=list)


class ProposalOut(AnswerModel):
    """A proposed mission: what an approver is shown."""

    hash: str
    """SHA-256, hexadecimal, of document, limits, lease and verdict; another verdict has another."""
    document: MissionDocument
    minutes: float
    parent: str | None = None
    change_of: str | None = None
    """Mission in flight whose navigation it changes; None for a mission of its own."""
    why: str = ""
    """The proposer's words; nobody has checked them."""
    summary: list[str] = Field(default_factory=list)
    """What would fly, in sentences made from the document."""
    difference: list[str] = Field(default_factory=list)
    """What differs from the last approved mission of the same name, or from its parent."""
    records: list[str] = Field(default_factory=list)
    """Cameras that run, and analyses of people."""
    actuators: list[str] = Field(default_factory=list)
    """Actuators that it would move, as `robot/actuator`."""
    lapses: float | None = None
    """Moment (Unix seconds) from which on its rehearsal is no longer good for an approval; None
    without one."""
    approval: ApprovalOut | None = None


class RefusedCallIn(RequestModel):
    """Call of an agent's tool that was refused before it reached the service, for the audit log."""

    tool: Annotated[str, Field(max_length=64)]
    text: Annotated[str, Field(max_length=1000)]
    """The refusal."""


class ChangeIn(RequestModel):
    """Waypoints that replace those of a robot in flight, and the reason."""

    robot: Word
    waypoints: Annotated[list[DocumentWaypoint], Field(min_length=1, max_length=1000), FailFast()]
    why: Annotated[str, Field(max_length=_LONGEST_REASON)] = ""

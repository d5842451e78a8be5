"""What the service and its clients say to each other: JSON models of the HTTP interface, version 1.

Units are metres, seconds, radians and m/s; moments are seconds of Unix time; a charge is 0 to 1.
"""

from __future__ import annotations

import enum
from collections import Counter
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, ConfigDict, FailFast, Field, field_validator

from aerodaas.dataflow.mission_document import DocumentWaypoint, MissionDocument
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.identifiers import ScopedWord, Word
from aerodaas.messages.health import Verdict
from aerodaas.messages.mission import Place, RobotStatus
from aerodaas.messages.waypoints import NavigationType, SchedulingType
from aerodaas.mission.commands import (
    AddNavigation,
    ClearNavigation,
    Command,
    End,
    Pause,
    Resume,
    ReturnHome,
)
from aerodaas.protocol.base import AnswerModel, Area, Minutes, Number, Positive, RequestModel
from aerodaas.protocol.proposals import ClearanceOut, ProposalOut

__all__ = [
    "COMMANDS",
    "USUAL_SCOPES",
    "AccountIn",
    "AccountOut",
    "AnalyticsOut",
    "AuditOut",
    "CommandIn",
    "CommandWord",
    "FleetOut",
    "FlightLeaseIn",
    "GrantIn",
    "LeaseIn",
    "LeaseOut",
    "LeaseState",
    "LinkState",
    "MissionIn",
    "MissionOut",
    "MissionPhase",
    "NavigationIn",
    "RefusalOut",
    "RobotOut",
    "Role",
    "Scope",
    "SilencePolicy",
    "StreamKind",
    "TenantChange",
    "TenantOut",
    "TokenIn",
    "TokenOut",
    "UsageOut",
    "VehicleReport",
    "VerdictOut",
    "Word",
    "word_for",
]

_MOST_ROBOTS = 64
_MOST_WAYPOINTS = 1000
_MOST_INDEX = 10_000
_YEAR_DAYS = 366
_MOST_STORED = 2**63 - 1
"""Largest whole number that a database holds."""


class Role(str, enum.Enum):
    """Role of an account; each role may do what those before it may."""

    VIEWER = "viewer"
    """See the fleet and one's own tenant's missions."""
    PILOT = "pilot"
    """Lease drones, fly missions and command them."""
    OPERATOR = "operator"
    """See and command all missions, approve, revoke leases."""
    ADMIN = "admin"
    """Manage accounts, tokens and quotas; read the audit log."""

    def reaches(self, wanted: Role) -> bool:
        """Whether this role may do what `wanted` may."""
        order = list(Role)
        return order.index(self) >= order.index(wanted)


class Scope(str, enum.Enum):
    """Purpose of a token, within its account's role."""

    FLY = "fly"
    SENSE = "sense"
    """Receive cameras' pictures and other sensors' items."""
    COMPUTE = "compute"
    """Run analyses on the provider's edge and cloud."""
    PROPOSE = "propose"
    """Propose missions, which another account approves before they fly: for agents. It excludes
    `fly`."""


USUAL_SCOPES = (Scope.FLY, Scope.SENSE, Scope.COMPUTE)
"""Scopes of an account that is no agent's."""


def _in_order(scopes: list[Scope]) -> list[Scope]:
    return [scope for scope in Scope if scope in scopes]


Scopes: TypeAlias = Annotated[list[Scope], AfterValidator(_in_order)]


class SilencePolicy(str, enum.Enum):
    """Behaviour of a mission when its user's connection is lost."""

    CONTINUE = "continue"
    RETURN = "return"


class LeaseState(str, enum.Enum):
    """State of a lease."""

    QUEUED = "queued"
    GRANTED = "granted"
    ENDED = "ended"
    """Given back, expired or revoked, as its reason says."""


class MissionPhase(str, enum.Enum):
    """State of a submitted mission at the service; its drones have states of their own."""

    PROPOSED = "proposed"
    """Kept and checked; it flies once it was rehearsed and approved."""
    SUBMITTED = "submitted"
    REHEARSING = "rehearsing"
    """Being flown in simulation first."""
    AWAITING_APPROVAL = "awaiting_approval"
    QUEUED = "queued"
    """Waiting for its lease."""
    FLYING = "flying"
    LANDED = "landed"
    """Over, as planned."""
    APPLIED = "applied"
    """Over: a change of another mission in flight, which flies it."""
    REFUSED = "refused"
    CANCELLED = "cancelled"
    FAILED = "failed"

    @property
    def over(self) -> bool:
        """Whether nothing follows this phase."""
        return self in {self.LANDED, self.APPLIED, self.REFUSED, self.CANCELLED, self.FAILED}


class StreamKind(str, enum.Enum):
    """Kind of items of a stream that a page can draw."""

    PICTURES = "pictures"
    DETECTIONS = "detections"
    NAVIGATION = "navigation"
    """Commands, of which the target of one that follows something is drawn."""


class PictureForm(str, enum.Enum):
    """How a live view sends the pictures of a camera; other items are the same in each."""

    WHOLE = "whole"
    """JPEG with depth, calibration and odometry, for programs."""
    JPEG = "jpeg"
    """JPEG alone, for a page."""
    H264 = "h264"
    """H.264 for a page whose browser decodes it (WebCodecs): a message has `key`, whether decoding
    can begin with it."""
    DEPTH = "depth"
    """The depth alone, as grey values to be coloured (`depth_picture`)."""


class LinkState(str, enum.Enum):
    """State of the link to a drone: who is connected, and whether it answers."""

    UNWATCHED = "unwatched"
    """Nobody is: it is out of service, or this service does not watch."""
    CONNECTING = "connecting"
    CONNECTED = "connected"
    """The service is, between missions."""
    MISSION = "mission"
    """The mission that flies it is."""
    LOST = "lost"
    """It does not answer."""


class RefusalOut(AnswerModel):
    """Answer to each request that is not carried out, with the HTTP status."""

    text: str
    """Why, and the remedy."""


class VehicleReport(AnswerModel):
    """Link to a vehicle, and what was heard over it last."""

    link: LinkState = LinkState.UNWATCHED
    since: float | None = None
    """Moment since which the link is so; of a lost one, when it was last heard."""
    heard: float | None = None
    """Moment of battery and position."""
    battery: float | None = None
    position: Place | None = None
    """Where it was last heard of."""
    mode: str = ""
    """What the vehicle says that it does, one of `VehicleMode`; empty where it is not known."""
    faults: list[str] = Field(default_factory=list)
    """What the vehicle complains of."""


class RobotOut(VehicleReport):
    """One drone of the fleet."""

    id: str
    sensors: list[str]
    """Full ids."""
    lease: str | None = None
    """Lease that holds it; None if it is free."""
    tenant: str | None = None
    """Tenant of that lease; shown to operators and to the tenant itself."""
    area: list[tuple[float, float]] | None = None
    """Where it stays under that lease, east and north, before the fence narrows it; shown as the
    tenant is. None without."""
    mission: str | None = None
    """Mission that flies it; shown as the tenant is, and to tenants that it shares cameras with."""
    shared: list[str] = Field(default_factory=list)
    """Cameras of that mission that one's own tenant may attach a mission to, by full id."""
    enabled: bool = True
    """False after an operator has taken it out of service."""
    objection: str = ""
    """Why it can be neither leased nor flown now; empty if it can, or is in flight."""
    preflight: Verdict | None = None
    """The gravest of the list before take-off; None in flight, and while nobody is
    connected."""


class FleetOut(AnswerModel):
    """The fleet, and the environment that an application's graph is built against."""

    name: str
    robots: list[RobotOut]
    environment: dict[str, Any]
    """An environment file's content without addresses, paths, drivers' settings and secrets."""


class LeaseIn(RequestModel):
    """Request of drones for a time."""

    robots: Annotated[list[Word], Field(min_length=1, max_length=_MOST_ROBOTS)] | None = None
    """By id; None for any one that fits."""
    camera: bool = False
    """Any one with a camera."""
    within: Positive | None = None
    """Metres from `near` at most, for any one."""
    near: tuple[Number, Number] = (0.0, 0.0)
    """East and north."""
    battery_minutes: Positive | None = None
    """Minutes that the charge must last, for any one."""
    minutes: Minutes = 15.0
    area: Area | None = None
    """Where the drones will stay; intersected with the provider's fence."""


class LeaseOut(AnswerModel):
    """A lease: while it is granted, its tenant alone flies its robots."""

    id: str
    tenant: str
    account: str
    robots: list[str]
    """Empty while any one is wanted and none is granted."""
    state: LeaseState
    reason: str = ""
    minutes: float
    asked: float
    granted: float | None = None
    ends: float | None = None
    """When a granted lease expires."""
    area: list[tuple[float, float]] | None = None


class FlightLeaseIn(RequestModel):
    """State of the lease of a flight, as the service tells the flight's process."""

    ends: Annotated[float, Field(allow_inf_nan=False)] | None = None
    """Unix seconds of its end; None once it has ended."""
    reason: str = ""
    """Why it has ended."""


class GrantIn(RequestModel):
    """Cameras that a tenant may attach missions to."""

    sensors: list[ScopedWord] = Field(default_factory=list, max_length=_MOST_ROBOTS)
    """Cameras by full id; none for all of the mission's."""


class MissionIn(RequestModel):
    """A mission to be flown, or to be attached to one in flight."""

    document: MissionDocument
    lease: str | None = None
    """None: one for the document's robots is requested with it, and given back after it."""
    minutes: Minutes = 15.0
    """Of the lease that is requested with it."""
    silence: SilencePolicy = SilencePolicy.CONTINUE
    silence_seconds: Annotated[float, Field(ge=1, le=3600)] = 30.0
    """Seconds without any request of the user after which the policy applies."""
    attach: str | None = None
    """A mission in flight that shares its cameras. The document then navigates nothing, and there
    is no lease: it runs until that flight ends, it is withdrawn, or its minutes are over."""
    share: list[Word] = Field(default_factory=list, max_length=_MOST_ROBOTS)
    """Tenants that may watch it."""
    grants: dict[Word, list[ScopedWord]] = Field(default_factory=dict, max_length=_MOST_ROBOTS)
    """Tenants that may attach missions to its cameras, as `GrantIn` says for each."""
    seed: Annotated[int, Field(ge=0, le=_MOST_STORED)] | None = None
    """Of a simulated fleet."""


class VerdictOut(AnswerModel):
    """Result of the rehearsal in simulation."""

    approved: bool
    reasons: list[str] = Field(default_factory=list)
    """Why it was refused; or what could not be rehearsed."""
    seconds: float | None = None
    """Mission time of the rehearsed flight."""
    distance: float | None = None
    battery_used: float | None = None
    picture: str | None = None
    """Path of a PNG of the flight, at this service."""
    tracks: dict[str, list[Place]] = Field(default_factory=dict)
    """Way that each robot flew in the air, coarse enough for a page to draw."""
    seeds: list[int] = Field(default_factory=list)
    """Seeds of the flights in simulation; each had to be good."""
    clearance: ClearanceOut | None = None
    """Smallest distance from an object, of all these flights; None in an empty world."""


class AnalyticsOut(AnswerModel):
    """Sums over the tasks of the analytics scheduler, from the start up to one time."""

    time: float
    """Mission time, seconds."""
    in_time: int = 0
    """Tasks with a result by their deadline."""
    late: int = 0
    """Tasks with a later result, or with none after they had begun."""
    dropped: int = 0
    """Tasks that were given up before they began."""
    edge: int = 0
    """Tasks that ended on the edge."""
    cloud: int = 0
    qos: float = 0.0
    """Utility of the results; `qoe` is the bonus of windows with enough of them in time."""
    qoe: float = 0.0

    @classmethod
    def of(cls, time: float, values: Mapping[str, Any]) -> AnalyticsOut | None:
        """Convert what a dispatcher reports; None before its first outcome."""
        outcomes, places = values.get("outcomes"), values.get("places", {})
        if not outcomes:
            return None
        return cls(
            time=time,
            in_time=outcomes.get("done", 0),
            late=sum(outcomes.get(name, 0) for name in ("late", "timeout", "failed")),
            dropped=outcomes.get("dropped", 0),
            edge=places.get("edge", 0),
            cloud=places.get("cloud", 0),
            qos=values["qos_total"],
            qoe=values["qoe_total"],
        )


class MissionOut(AnswerModel):
    """A mission and its newest state."""

    id: str
    name: str
    tenant: str
    account: str
    phase: MissionPhase
    reason: str = ""
    robots: list[str]
    lease: str | None = None
    share: list[str] = Field(default_factory=list)
    """Tenants that may watch it."""
    attach: str | None = None
    """The mission in flight by whose cameras it senses; None for one that flies itself."""
    grants: dict[str, list[str]] = Field(default_factory=dict)
    """Tenants that may attach missions, with the cameras; no camera for all of them."""
    submitted: float
    started: float | None = None
    ended: float | None = None
    verdict: VerdictOut | None = None
    status: dict[str, RobotStatus] = Field(default_factory=dict)
    """Newest status by robot, while it flies and afterwards."""
    places: dict[str, dict[str, Place]] = Field(default_factory=dict)
    """Places of the waypoints that lie behind each robot, by id; those known last."""
    told: dict[str, float] = Field(default_factory=dict)
    """Unix seconds when that status came, by robot, while it flies: once nothing comes any more,
    what is told here is as old as that."""
    alerts: list[str] = Field(default_factory=list)
    """The newest alerts, oldest first."""
    streams: dict[str, StreamKind] = Field(default_factory=dict)
    """Streams of pictures and of what was found in them, by name, while it flies."""
    analytics: AnalyticsOut | None = None
    """What the analytics scheduler has done so far; None without one, and after the flight."""
    recording: bool = False
    """Whether the recording can be fetched."""
    proposal: ProposalOut | None = None
    """What an approver is shown; None for a mission that was submitted to be flown."""


CommandWord: TypeAlias = Literal["pause", "resume", "clear", "return-home", "land"]

COMMANDS: Mapping[CommandWord, Command] = {
    "pause": Pause(),
    "resume": Resume(),
    "clear": ClearNavigation(),
    "return-home": ReturnHome("its user asked to return"),
    "land": End("its user asked to land"),
}
"""Commands to a flying robot by the word that the wire has for each."""


def word_for(command: Command) -> CommandWord | None:
    """The word for a command; None for one that the wire has no word for."""
    return next((word for word, one in COMMANDS.items() if type(one) is type(command)), None)


class CommandIn(RequestModel):
    """A command to one robot of a mission."""

    robot: Word
    command: CommandWord


class NavigationIn(RequestModel):
    """Waypoints for one robot of a mission in flight: one command, carried out whole."""

    # Numbers must be JSON numbers.
    model_config = ConfigDict(strict=True)

    waypoints: Annotated[
        list[DocumentWaypoint], Field(min_length=1, max_length=_MOST_WAYPOINTS), FailFast()
    ]
    ordered: bool = True
    """Whether to keep their order; otherwise the scheduler chooses it."""
    index: Annotated[int, Field(ge=0, le=_MOST_INDEX)] | None = None
    """Number of waypoints of the same priority to visit before these."""
    robot: Word
    deadline: Number | None = None
    """Seconds of mission time for waypoints that have no deadline, or a later one."""
    clear_first: bool = False
    """Empty the robot's queue first."""

    @field_validator("waypoints")
    @classmethod
    def _distinct(cls, waypoints: list[DocumentWaypoint]) -> list[DocumentWaypoint]:
        counts = Counter(waypoint.id for waypoint in waypoints)
        twice = sorted(name for name, count in counts.items() if count > 1)
        if twice:
            message = f"more than one waypoint is called {', '.join(twice)}"
            raise ValueError(message)
        return waypoints

    def command(self) -> AddNavigation:
        """The command; raises InvalidWaypointError for waypoints that cannot be flown."""
        navigation = AeroNavigation(
            NavigationType.ANALYTICS_DRIVEN,
            self.waypoints,
            SchedulingType.ORDERED if self.ordered else SchedulingType.UNORDERED,
        )
        return AddNavigation(navigation, self.index, self.deadline, clear_first=self.clear_first)


class AccountIn(RequestModel):
    """A new account, or changes of one."""

    name: Word
    tenant: Word
    role: Role = Role.PILOT
    scopes: Scopes = Field(default_factory=lambda: list(USUAL_SCOPES))


class AccountOut(AnswerModel):
    """An account."""

    name: Word
    tenant: Word
    role: Role
    scopes: Scopes
    created: float
    disabled: bool = False


class TokenIn(RequestModel):
    """Request of a token for an account."""

    account: Word
    days: Annotated[float, Field(gt=0, le=_YEAR_DAYS)] = 30.0
    scopes: list[Scope] | None = None
    """None: all of the account's."""


class TokenOut(AnswerModel):
    """A token; its secret is shown once."""

    id: str
    account: str
    scopes: Scopes
    created: float
    expires: float
    revoked: bool = False
    secret: str | None = None
    """What a request carries as `Authorization: Bearer …`; only in the answer that creates it."""


class AuditOut(AnswerModel):
    """One entry of the audit log."""

    at: float
    account: str
    """Empty for a request without a valid token, and for what the service itself does."""
    tenant: str
    address: str
    action: str
    """`lease.request`, `mission.submit`, `token.refused`, …"""
    target: str = ""
    accepted: bool
    text: str = ""


class TenantChange(RequestModel):
    """Quotas of a tenant; what is not given stays, and null is no limit."""

    weight: Positive = 1.0
    """Share of an edge that is shared, relative to the other tenants'."""
    flight_minutes: Annotated[Number, Field(ge=0)] | None = None
    """Minutes in the air, of all its robots together, in a calendar month (UTC)."""
    cloud_calls: Annotated[int, Field(ge=0, le=_MOST_STORED)] | None = None
    """Calls of cloud nodes and endpoints in a month."""
    storage_bytes: Annotated[int, Field(ge=0, le=_MOST_STORED)] | None = None
    """Bytes of recordings kept."""
    max_height: Positive | None = None
    """Metres above home."""
    max_speed: Positive | None = None
    """m/s."""


class TenantOut(TenantChange):
    """A tenant, with what it may use."""

    name: str
    created: float


class UsageOut(AnswerModel):
    """Usage of one mission."""

    mission: str
    tenant: str
    account: str
    started: float
    flight_seconds: float
    distance: float
    battery_used: float
    """Sum over its robots of the share of a full charge."""
    compute_seconds: dict[str, float] = Field(default_factory=dict)
    """Processor's seconds of analyses, by compute resource."""
    cloud_calls: int = 0
    recorded_bytes: int = 0
    kept: bool = True
    """Whether the recording is here."""

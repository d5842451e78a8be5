"""What the service keeps, as plain values: one class a table.

Moments are seconds of Unix time, lengths metres, durations as their names say.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from aerodaas.protocol.schemas import LeaseState, MissionPhase, Role, Scope

__all__ = [
    "Account",
    "AuditEntry",
    "Lease",
    "LeaseEnd",
    "Mission",
    "RobotState",
    "Tenant",
    "Token",
    "Usage",
]


@dataclass(frozen=True, slots=True)
class Tenant:
    """A group of accounts that shares quotas, leases and missions; None is no limit."""

    name: str
    created: float = 0.0
    weight: float = 1.0
    """Share of an edge that is shared, relative to the other tenants'; positive."""
    flight_minutes: float | None = None
    """Minutes in the air, of all its robots together, in a calendar month (UTC)."""
    cloud_calls: int | None = None
    """Calls of cloud nodes and endpoints in a month."""
    storage_bytes: int | None = None
    """Bytes of recordings kept."""
    max_height: float | None = None
    """Metres above home."""
    max_speed: float | None = None
    """m/s."""


@dataclass(frozen=True, slots=True)
class Account:
    """Somebody who uses the service."""

    name: str
    tenant: str
    role: Role
    scopes: frozenset[Scope]
    created: float
    disabled: bool = False
    subject: str | None = None
    """Who it is at an OpenID Connect issuer: that one's URL and its id of them."""


@dataclass(frozen=True, slots=True)
class Token:
    """A token of an account; of its secret only the SHA-256 is kept."""

    id: str
    account: str
    digest: str
    """SHA-256 of the secret, hexadecimal."""
    scopes: frozenset[Scope]
    created: float
    expires: float
    revoked: bool = False


class LeaseEnd(str, enum.Enum):
    """Why a lease has ended."""

    GIVEN_BACK = "given_back"
    EXPIRED = "expired"
    REVOKED = "revoked"


@dataclass(frozen=True, slots=True)
class Lease:
    """A request of drones and what became of it."""

    id: str
    number: int
    """Place in the queue: a lower one was asked for earlier."""
    tenant: str
    account: str
    minutes: float
    asked: float
    wanted: tuple[str, ...] = ()
    """Robots by id; empty for any one that fits."""
    camera: bool = False
    within: float | None = None
    near: tuple[float, float] = (0.0, 0.0)
    battery_minutes: float | None = None
    area: tuple[tuple[float, float], ...] | None = None
    state: LeaseState = LeaseState.QUEUED
    robots: tuple[str, ...] = ()
    """Those that it holds or held; empty while it is queued."""
    granted: float | None = None
    ends: float | None = None
    """When it expires, once it is granted."""
    ended: float | None = None
    end: LeaseEnd | None = None
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Mission:
    """A submitted mission; its document lies in its folder."""

    id: str
    name: str
    tenant: str
    account: str
    phase: MissionPhase
    robots: tuple[str, ...]
    submitted: float
    folder: str
    reason: str = ""
    lease: str | None = None
    started: float | None = None
    ended: float | None = None
    request: Mapping[str, Any] = field(default_factory=dict)
    """JSON of `MissionIn` without its document."""
    verdict: Mapping[str, Any] | None = None
    """JSON of `VerdictOut`."""
    key: str | None = None
    """Idempotency key of its submission; no two missions of a tenant have the same."""
    fingerprint: str | None = None
    """SHA-256 of the submission with that key, hexadecimal."""


@dataclass(frozen=True, slots=True)
class RobotState:
    """What is known of a drone between its missions."""

    id: str
    enabled: bool = True
    battery: float | None = None
    """Charge left, 0 to 1."""
    position: tuple[float, float, float] | None = None
    """Metres east, north and up of home."""
    heard: float | None = None


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """Who did what, or tried to."""

    at: float
    account: str
    tenant: str
    address: str
    action: str
    accepted: bool
    target: str = ""
    text: str = ""
    number: int = 0
    """Counted by the database; 0 before."""


@dataclass(frozen=True, slots=True)
class Usage:
    """What one mission has used."""

    mission: str
    tenant: str
    account: str
    started: float
    flight_seconds: float = 0.0
    """Seconds in the air, summed over its robots."""
    distance: float = 0.0
    battery_used: float = 0.0
    """Sum over its robots of the share of a full charge."""
    compute_seconds: Mapping[str, float] = field(default_factory=dict)
    """Processor's seconds of analyses, by compute resource."""
    cloud_calls: int = 0
    recorded_bytes: int = 0
    kept: bool = True
    """Whether the recording still takes up storage."""

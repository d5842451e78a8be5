"""Rows of the service: one mapped class a table, whose annotations are its columns.

A row is a plain value that belongs to no open transaction; `dataclasses.replace` makes a changed
one. Moments are seconds of Unix time, lengths metres, durations as their names say.
"""

import enum
import json
from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import TypeAdapter
from sqlalchemy import (
    BigInteger,
    CheckConstraint,
    Dialect,
    Double,
    Enum,
    ForeignKey,
    Index,
    Integer,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, MappedAsDataclass, mapped_column
from sqlalchemy.types import TypeDecorator

from aerodaas.protocol.schemas import LeaseState, MissionPhase, Role, Scope

__all__ = [
    "Account",
    "AuditEntry",
    "Lease",
    "LeaseEnd",
    "Mission",
    "RobotState",
    "Row",
    "SchemaVersion",
    "Tenant",
    "Token",
    "Usage",
]


class _StorableText(TypeDecorator[str]):
    """A text of any length; what a database cannot hold (half a surrogate pair, 0) is replaced."""

    impl = Text
    cache_ok = True

    def process_bind_param(self, value: str | None, dialect: Dialect) -> str | None:  # noqa: ARG002
        if value is None:
            return None
        text = value.encode("utf-8", "replace").decode()
        return text.replace("\0", "\N{REPLACEMENT CHARACTER}")


class _Json(TypeDecorator[Any]):
    """A value of the annotation `kind`, as a text of JSON."""

    impl = Text
    cache_ok = True

    def __init__(self, kind: Any) -> None:  # noqa: ANN401 - an annotation
        super().__init__()
        self.kind = kind
        self._adapter = TypeAdapter(kind)

    def process_bind_param(self, value: object, dialect: Dialect) -> str | None:  # noqa: ARG002
        if value is None:
            return None
        return json.dumps(sorted(value) if isinstance(value, frozenset) else value, allow_nan=False)

    def process_result_value(self, value: str | None, dialect: Dialect) -> Any:  # noqa: ANN401, ARG002
        return None if value is None else self._adapter.validate_python(json.loads(value))


_JSON = (
    Mapping[str, Any],
    Mapping[str, float],
    frozenset[Scope],
    tuple[str, ...],
    tuple[float, float],
    tuple[float, float, float],
    tuple[tuple[float, float], ...],
)


class Row(MappedAsDataclass, DeclarativeBase):
    """Base of every table's class; its metadata holds the tables."""

    type_annotation_map: ClassVar[dict[Any, Any]] = {
        str: _StorableText(),
        float: Double(),
        # SQLite counts only a key of its type INTEGER, which has 64 bits there.
        int: BigInteger().with_variant(Integer, "sqlite"),
        enum.Enum: Enum(
            enum.Enum,
            native_enum=False,
            length=32,
            values_callable=lambda kind: [member.value for member in kind],
        ),
        **{kind: _Json(kind) for kind in _JSON},
    }


class SchemaVersion(Row):
    """Version of the tables, in one row."""

    __tablename__ = "schema_version"

    version: Mapped[int] = mapped_column(primary_key=True, autoincrement=False)


class Tenant(Row):
    """A group of accounts that shares quotas, leases and missions; None is no limit."""

    __tablename__ = "tenants"

    name: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[float] = mapped_column(default=0.0)
    weight: Mapped[float] = mapped_column(CheckConstraint("weight > 0"), default=1.0)
    """Share of an edge that is shared, relative to the other tenants'; positive."""
    flight_minutes: Mapped[float | None] = mapped_column(default=None)
    """Minutes in the air, of all its robots together, in a calendar month (UTC)."""
    cloud_calls: Mapped[int | None] = mapped_column(default=None)
    """Calls of cloud nodes and endpoints in a month."""
    storage_bytes: Mapped[int | None] = mapped_column(default=None)
    """Bytes of recordings kept."""
    max_height: Mapped[float | None] = mapped_column(default=None)
    """Metres above home."""
    max_speed: Mapped[float | None] = mapped_column(default=None)
    """m/s."""


class Account(Row):
    """Account of a user of the service."""

    __tablename__ = "accounts"

    name: Mapped[str] = mapped_column(primary_key=True)
    tenant: Mapped[str] = mapped_column(ForeignKey("tenants.name"), index=True)
    role: Mapped[Role]
    scopes: Mapped[frozenset[Scope]]
    created: Mapped[float]
    disabled: Mapped[bool] = mapped_column(default=False)
    subject: Mapped[str | None] = mapped_column(default=None, unique=True)
    """Subject at an OpenID Connect issuer: the issuer's URL and its id of the account."""


class Token(Row):
    """A token of an account; of its secret only the SHA-256 is kept."""

    __tablename__ = "tokens"

    id: Mapped[str] = mapped_column(primary_key=True)
    account: Mapped[str] = mapped_column(ForeignKey("accounts.name"), index=True)
    digest: Mapped[str]
    """SHA-256 of the secret, hexadecimal."""
    scopes: Mapped[frozenset[Scope]]
    created: Mapped[float]
    expires: Mapped[float]
    revoked: Mapped[bool] = mapped_column(default=False)


class LeaseEnd(str, enum.Enum):
    """Why a lease has ended."""

    GIVEN_BACK = "given_back"
    EXPIRED = "expired"
    REVOKED = "revoked"


class Lease(Row):
    """A request of drones and what became of it."""

    __tablename__ = "leases"

    id: Mapped[str] = mapped_column(primary_key=True)
    number: Mapped[int] = mapped_column(unique=True)
    """Place in the queue: a lower one was asked for earlier."""
    tenant: Mapped[str] = mapped_column(ForeignKey("tenants.name"), index=True)
    account: Mapped[str] = mapped_column(ForeignKey("accounts.name"))
    minutes: Mapped[float]
    asked: Mapped[float]
    wanted: Mapped[tuple[str, ...]] = mapped_column(default=())
    """Robots by id; empty for any one that fits."""
    camera: Mapped[bool] = mapped_column(default=False)
    within: Mapped[float | None] = mapped_column(default=None)
    near: Mapped[tuple[float, float]] = mapped_column(default=(0.0, 0.0))
    battery_minutes: Mapped[float | None] = mapped_column(default=None)
    area: Mapped[tuple[tuple[float, float], ...] | None] = mapped_column(default=None)
    state: Mapped[LeaseState] = mapped_column(default=LeaseState.QUEUED, index=True)
    robots: Mapped[tuple[str, ...]] = mapped_column(default=())
    """Robots that it holds or held; empty while it is queued."""
    granted: Mapped[float | None] = mapped_column(default=None)
    ends: Mapped[float | None] = mapped_column(default=None)
    """When it expires, once it is granted."""
    ended: Mapped[float | None] = mapped_column(default=None)
    end: Mapped[LeaseEnd | None] = mapped_column(default=None)
    reason: Mapped[str] = mapped_column(default="")


class Mission(Row):
    """A submitted mission; its document lies in its folder."""

    __tablename__ = "missions"
    __table_args__ = (
        # Those without a key are not compared: NULL equals nothing.
        UniqueConstraint("tenant", "key"),
        Index("missions_newest", "tenant", "submitted"),
    )

    id: Mapped[str] = mapped_column(primary_key=True)
    name: Mapped[str]
    tenant: Mapped[str] = mapped_column(ForeignKey("tenants.name"))
    account: Mapped[str] = mapped_column(ForeignKey("accounts.name"))
    phase: Mapped[MissionPhase] = mapped_column(index=True)
    robots: Mapped[tuple[str, ...]]
    submitted: Mapped[float]
    folder: Mapped[str]
    reason: Mapped[str] = mapped_column(default="")
    lease: Mapped[str | None] = mapped_column(ForeignKey("leases.id"), default=None)
    started: Mapped[float | None] = mapped_column(default=None)
    ended: Mapped[float | None] = mapped_column(default=None)
    request: Mapped[Mapping[str, Any]] = mapped_column(default_factory=dict)
    """JSON of `MissionIn` without its document."""
    verdict: Mapped[Mapping[str, Any] | None] = mapped_column(default=None)
    """JSON of `VerdictOut`."""
    key: Mapped[str | None] = mapped_column(default=None)
    """Idempotency key of its submission; no two missions of a tenant have the same."""
    fingerprint: Mapped[str | None] = mapped_column(default=None)
    """SHA-256 of the submission with that key, hexadecimal."""


class RobotState(Row):
    """State of a drone between its missions."""

    __tablename__ = "robots"

    id: Mapped[str] = mapped_column(primary_key=True)
    enabled: Mapped[bool] = mapped_column(default=True)
    battery: Mapped[float | None] = mapped_column(default=None)
    """Charge left, 0 to 1."""
    position: Mapped[tuple[float, float, float] | None] = mapped_column(default=None)
    """Metres east, north and up of home."""
    heard: Mapped[float | None] = mapped_column(default=None)


class AuditEntry(Row):
    """Entry of the audit log."""

    __tablename__ = "audit"
    __table_args__ = {"sqlite_autoincrement": True}  # noqa: RUF012 - SQLAlchemy's own

    at: Mapped[float]
    account: Mapped[str]
    tenant: Mapped[str]
    address: Mapped[str]
    action: Mapped[str]
    accepted: Mapped[bool]
    target: Mapped[str] = mapped_column(default="")
    text: Mapped[str] = mapped_column(default="")
    number: Mapped[int] = mapped_column(primary_key=True, init=False)
    """Counted by the database."""


class Usage(Row):
    """Usage of one mission."""

    __tablename__ = "usage"
    __table_args__ = (Index("usage_by_month", "tenant", "started"),)

    mission: Mapped[str] = mapped_column(ForeignKey("missions.id"), primary_key=True)
    tenant: Mapped[str] = mapped_column(ForeignKey("tenants.name"))
    account: Mapped[str] = mapped_column(ForeignKey("accounts.name"))
    started: Mapped[float]
    flight_seconds: Mapped[float] = mapped_column(default=0.0)
    """Seconds in the air, summed over its robots."""
    distance: Mapped[float] = mapped_column(default=0.0)
    battery_used: Mapped[float] = mapped_column(default=0.0)
    """Sum over its robots of the share of a full charge."""
    compute_seconds: Mapped[Mapping[str, float]] = mapped_column(default_factory=dict)
    """Processor's seconds of analyses, by compute resource."""
    cloud_calls: Mapped[int] = mapped_column(default=0)
    recorded_bytes: Mapped[int] = mapped_column(default=0)
    kept: Mapped[bool] = mapped_column(default=True)
    """Whether the recording still takes up storage."""

"""The database's tables: a column for each field of the classes in `rows`, in their order."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    CheckConstraint,
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    Table,
    UniqueConstraint,
)

from aerodaas.protocol.schemas import LeaseState, MissionPhase, Role, Scope
from aerodaas.service.store.columns import EnumText, JsonText, Words, tuples
from aerodaas.service.store.rows import LeaseEnd

__all__ = [
    "ACCOUNTS",
    "AUDIT",
    "LEASES",
    "METADATA",
    "MISSIONS",
    "ROBOTS",
    "SCHEMA",
    "TENANTS",
    "TOKENS",
    "USAGE",
]

METADATA = MetaData()


def _scopes(names: list[str]) -> frozenset[Scope]:
    return frozenset(map(Scope, names))


SCHEMA = Table("schema_version", METADATA, Column("version", Integer, primary_key=True))

TENANTS = Table(
    "tenants",
    METADATA,
    Column("name", Words, primary_key=True),
    Column("created", Double, nullable=False),
    Column("weight", Double, CheckConstraint("weight > 0"), nullable=False),
    Column("flight_minutes", Double),
    Column("cloud_calls", BigInteger),
    Column("storage_bytes", BigInteger),
    Column("max_height", Double),
    Column("max_speed", Double),
)

ACCOUNTS = Table(
    "accounts",
    METADATA,
    Column("name", Words, primary_key=True),
    Column("tenant", Words, ForeignKey("tenants.name"), nullable=False, index=True),
    Column("role", EnumText(Role), nullable=False),
    Column("scopes", JsonText(_scopes), nullable=False),
    Column("created", Double, nullable=False),
    Column("disabled", Boolean, nullable=False),
    Column("subject", Words, unique=True),
)

TOKENS = Table(
    "tokens",
    METADATA,
    Column("id", Words, primary_key=True),
    Column("account", Words, ForeignKey("accounts.name"), nullable=False, index=True),
    Column("digest", Words, nullable=False),
    Column("scopes", JsonText(_scopes), nullable=False),
    Column("created", Double, nullable=False),
    Column("expires", Double, nullable=False),
    Column("revoked", Boolean, nullable=False),
)

LEASES = Table(
    "leases",
    METADATA,
    Column("id", Words, primary_key=True),
    Column("number", BigInteger, nullable=False, unique=True),
    Column("tenant", Words, ForeignKey("tenants.name"), nullable=False, index=True),
    Column("account", Words, ForeignKey("accounts.name"), nullable=False),
    Column("minutes", Double, nullable=False),
    Column("asked", Double, nullable=False),
    Column("wanted", JsonText(tuples), nullable=False),
    Column("camera", Boolean, nullable=False),
    Column("within", Double),
    Column("near", JsonText(tuples), nullable=False),
    Column("battery_minutes", Double),
    Column("area", JsonText(tuples)),
    Column("state", EnumText(LeaseState), nullable=False, index=True),
    Column("robots", JsonText(tuples), nullable=False),
    Column("granted", Double),
    Column("ends", Double),
    Column("ended", Double),
    Column("end", EnumText(LeaseEnd)),
    Column("reason", Words, nullable=False),
)

MISSIONS = Table(
    "missions",
    METADATA,
    Column("id", Words, primary_key=True),
    Column("name", Words, nullable=False),
    Column("tenant", Words, ForeignKey("tenants.name"), nullable=False),
    Column("account", Words, ForeignKey("accounts.name"), nullable=False),
    Column("phase", EnumText(MissionPhase), nullable=False, index=True),
    Column("robots", JsonText(tuples), nullable=False),
    Column("submitted", Double, nullable=False),
    Column("folder", Words, nullable=False),
    Column("reason", Words, nullable=False),
    Column("lease", Words, ForeignKey("leases.id")),
    Column("started", Double),
    Column("ended", Double),
    Column("request", JsonText(), nullable=False),
    Column("verdict", JsonText()),
    Column("key", Words),
    Column("fingerprint", Words),
    # Those without a key are not compared: NULL equals nothing.
    UniqueConstraint("tenant", "key"),
    Index("missions_newest", "tenant", "submitted"),
)

ROBOTS = Table(
    "robots",
    METADATA,
    Column("id", Words, primary_key=True),
    Column("enabled", Boolean, nullable=False),
    Column("battery", Double),
    Column("position", JsonText(tuples)),
    Column("heard", Double),
)

AUDIT = Table(
    "audit",
    METADATA,
    Column("at", Double, nullable=False),
    Column("account", Words, nullable=False),
    Column("tenant", Words, nullable=False),
    Column("address", Words, nullable=False),
    Column("action", Words, nullable=False),
    Column("accepted", Boolean, nullable=False),
    Column("target", Words, nullable=False),
    Column("text", Words, nullable=False),
    # SQLite counts only a key of its type INTEGER, which has 64 bits there.
    Column("number", BigInteger().with_variant(Integer, "sqlite"), primary_key=True),
    sqlite_autoincrement=True,
)

USAGE = Table(
    "usage",
    METADATA,
    Column("mission", Words, ForeignKey("missions.id"), primary_key=True),
    Column("tenant", Words, ForeignKey("tenants.name"), nullable=False),
    Column("account", Words, ForeignKey("accounts.name"), nullable=False),
    Column("started", Double, nullable=False),
    Column("flight_seconds", Double, nullable=False),
    Column("distance", Double, nullable=False),
    Column("battery_used", Double, nullable=False),
    Column("compute_seconds", JsonText(), nullable=False),
    Column("cloud_calls", BigInteger, nullable=False),
    Column("recorded_bytes", BigInteger, nullable=False),
    Column("kept", Boolean, nullable=False),
    Index("usage_by_month", "tenant", "started"),
)

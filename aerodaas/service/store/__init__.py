"""The service's database: accounts, tokens, tenants, leases, missions, audit, usage and robots."""

from aerodaas.service.errors import StoreError
from aerodaas.service.store.rows import (
    Account,
    AuditEntry,
    Lease,
    LeaseEnd,
    Mission,
    RobotState,
    Tenant,
    Token,
    Usage,
)
from aerodaas.service.store.store import Leases, Store

__all__ = [
    "Account",
    "AuditEntry",
    "Lease",
    "LeaseEnd",
    "Leases",
    "Mission",
    "RobotState",
    "Store",
    "StoreError",
    "Tenant",
    "Token",
    "Usage",
]

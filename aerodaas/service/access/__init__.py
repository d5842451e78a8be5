"""Who may do what at the service: accounts, tokens, roles, rate limits, quotas, audit log."""

from aerodaas.service.access.access import Access
from aerodaas.service.access.accounts import Accounts
from aerodaas.service.access.audit import Audit
from aerodaas.service.access.oidc import OidcSettings, OidcVerifier
from aerodaas.service.access.principal import Principal, require, sees
from aerodaas.service.access.quotas import Quotas, QuotasLeft
from aerodaas.service.access.rates import RateLimiter
from aerodaas.service.access.usage import usage_csv, usage_out
from aerodaas.service.errors import RefusedError

__all__ = [
    "Access",
    "Accounts",
    "Audit",
    "OidcSettings",
    "OidcVerifier",
    "Principal",
    "Quotas",
    "QuotasLeft",
    "RateLimiter",
    "RefusedError",
    "require",
    "sees",
    "usage_csv",
    "usage_out",
]

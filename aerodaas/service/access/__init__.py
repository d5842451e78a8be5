"""Accounts, tokens, roles, rate limits, quotas and the audit log of a service."""

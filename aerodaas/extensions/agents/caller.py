"""The account that calls a tool: its client of the service, and refusals worded for a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeAlias, TypeVar
from weakref import WeakValueDictionary

import anyio
import anyio.to_thread
from mcp.server.mcpserver import Context
from mcp.server.mcpserver.exceptions import ToolError

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import AeroDaaSError, SourceError
from aerodaas.extensions.agents.text import plain

__all__ = ["Call", "Caller", "Callers", "RefusedByServiceError", "refusal"]

T = TypeVar("T")
Call: TypeAlias = Context[Any, Any]
"""One call of a tool, as the SDK has it."""
_REQUESTS = 8
"""Requests of one caller to the service at a time; further ones wait. It refuses twice as many."""
_LONGEST = 1000
"""Characters of a refusal."""


class RefusedByServiceError(ToolError):
    """Refusal of the service, which has audited it."""


@dataclass(frozen=True)
class Caller:
    """One account at the service."""

    client: ProviderClient
    """With the account's own token: a tool may do what that token may, and nothing else."""
    page: str
    """Address of the console, without a token."""
    key: str = field(default="", repr=False)
    """What tells it from other callers of the same server."""

    def link(self, mission: str) -> str:
        """Address of a mission's page, on which a person approves it."""
        return f"{self.page}/#mission={mission}"


class Callers:
    """Asks the service as the account that calls, in threads of its own."""

    def __init__(self, caller: Callable[[Call], Caller]) -> None:
        """Find whoever calls by `caller`."""
        self._caller = caller
        # In threads of their own: the service's answer meanwhile, and may wait for none of these.
        self._limiters: WeakValueDictionary[str, anyio.CapacityLimiter] = WeakValueDictionary()

    def of(self, call: Call) -> Caller:
        """Whoever calls."""
        return self._caller(call)

    async def ask(
        self, call: Call, question: Callable[[ProviderClient], T], *, urgent: bool = False
    ) -> T:
        """Ask the service.

        Args:
            call: Call of a tool.
            question: Asks the caller's client.
            urgent: Whether it waits for none of the caller's other requests.

        Returns:
            What `question` returned.

        Raises:
            RefusedByServiceError: With the service's own figures and remedy; without its address.
        """
        caller = self._caller(call)
        limiter = anyio.CapacityLimiter(_REQUESTS)
        if not urgent:
            limiter = self._limiters.setdefault(caller.key, limiter)
        try:
            return await anyio.to_thread.run_sync(question, caller.client, limiter=limiter)
        except AeroDaaSError as error:
            raise RefusedByServiceError(refusal(error, caller.client)) from None


def refusal(error: AeroDaaSError, client: ProviderClient) -> str:
    """Wording of an error for a model, without the address of the service.

    Args:
        error: What a client raised.
        client: The client.
    """
    if isinstance(error, SourceError):
        return "the service does not answer at present: call again in a few seconds"
    text = str(error).removeprefix(f"{client.address.host}: ")
    return plain(text.replace(client.address.base, "the service"), _LONGEST)

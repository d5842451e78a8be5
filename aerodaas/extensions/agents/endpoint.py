"""The agents' way into a service: streamable HTTP at `/mcp`, with the service's own tokens.

The service's limits and admission come first, as for each request. Tools then ask the API with the
token that the request carried: nothing here has a right of its own.
"""

from __future__ import annotations

import asyncio
from collections.abc import MutableMapping
from http import HTTPStatus
from typing import Any
from urllib.parse import urlsplit

from mcp.server.transport_security import TransportSecuritySettings
from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from aerodaas.config.redaction import catalogue
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.extensions.agents.caller import Call, Caller
from aerodaas.extensions.agents.server import AgentServer
from aerodaas.http_server.addresses import HostGuard
from aerodaas.protocol.schemas import Role
from aerodaas.protocol.schemas import Scope as TokenScope
from aerodaas.service.app import Endpoint
from aerodaas.service.http.gate import Admission, bearer
from aerodaas.service.http.limits import AGENTS_PATH
from aerodaas.service.settings import ServiceSettings

__all__ = ["endpoint"]

_METADATA = f"/.well-known/oauth-protected-resource{AGENTS_PATH}"
"""Where a client learns who issues tokens (RFC 9728)."""


def endpoint(admission: Admission, settings: ServiceSettings, address: str) -> Endpoint:
    """Make the endpoint of a service.

    Args:
        admission: Knows the sender of each request.
        settings: Of the service.
        address: Where this machine reaches the API without TLS.
    """
    public = (settings.public or address).rstrip("/")

    def caller(call: Call) -> Caller:
        request = call.request_context.request
        if request is None:
            raise RuntimeError("a call over HTTP has a request")
        token = bearer(request.headers)
        return Caller(ProviderClient(address, token), public, token)

    server = AgentServer(caller, catalogue(settings.config))
    # The address by which a browser came is checked by `HostGuard`, before the token is.
    server.streamable_http_app(
        streamable_http_path=AGENTS_PATH,
        stateless_http=True,
        transport_security=TransportSecuritySettings(enable_dns_rebinding_protection=False),
    )
    manager = server.session_manager

    async def answer(scope: Scope, receive: Receive, send: Send) -> None:
        # A person's token would let a model do what the person may.
        connection = HTTPConnection(scope)
        await asyncio.to_thread(
            admission.require, connection, Role.PILOT, TokenScope.PROPOSE, agents=True
        )
        await manager.handle_request(scope, receive, send)

    issuers = [] if settings.oidc is None else [settings.oidc.issuer]
    metadata = {
        "resource": f"{public}{AGENTS_PATH}",
        "authorization_servers": issuers,
        "scopes_supported": [TokenScope.PROPOSE.value],
        "bearer_methods_supported": ["header"],
    }

    def before(app: ASGIApp) -> ASGIApp:
        return _Challenges(app, public, metadata)

    return Endpoint(AGENTS_PATH, _AsgiApp(answer), before, manager.run)


class _AsgiApp:
    """An application as an object, which a route does not take for a function of a request."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self._app(scope, receive, send)


class _Challenges:
    """Middleware that tells clients without a good token where to get one."""

    def __init__(self, app: ASGIApp, public: str, metadata: dict[str, Any]) -> None:
        self._app = app
        self._guarded = HostGuard(self._answer, urlsplit(public).hostname or "")
        self._metadata = metadata
        where = f'resource_metadata="{public}{_METADATA}"'
        short = f'error="insufficient_scope", scope="{TokenScope.PROPOSE.value}"'
        self._challenges = {
            HTTPStatus.UNAUTHORIZED: f"Bearer {where}".encode(),
            HTTPStatus.FORBIDDEN: f"Bearer {short}, {where}".encode(),
        }

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer what is the endpoint's own, and forward all else."""
        own = scope["type"] == "http" and scope["path"] in {AGENTS_PATH, _METADATA}
        await (self._guarded if own else self._app)(scope, receive, send)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["path"] == _METADATA:
            await JSONResponse(self._metadata)(scope, receive, send)
            return

        async def challenging(message: MutableMapping[str, Any]) -> None:
            challenge = self._challenges.get(message.get("status", 0))
            if challenge is not None:
                kept = [one for one in message["headers"] if one[0] != b"www-authenticate"]
                message = {**message, "headers": [*kept, (b"www-authenticate", challenge)]}
            await send(message)

        await self._app(scope, receive, challenging)

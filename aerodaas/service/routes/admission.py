"""Admission of requests: who asks, whether they may, how often; and how refusals are worded."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from aerodaas.service.access import Access, Audit, Principal, RateLimiter, require
from aerodaas.service.schemas import RefusalOut, Role, Scope
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.types.errors import AeroDaaSError

__all__ = ["Admission", "close_refused", "register_refusals"]

_POLICY_VIOLATION = 1008
_UNPROCESSABLE = 422
_UNAVAILABLE = 503
_MOST_TEXT = 120
"""Bytes of a WebSocket's closing reason (RFC 6455), less the code."""


class Admission:
    """Looks up the account of each request."""

    def __init__(self, access: Access, audit: Audit, rates: RateLimiter) -> None:
        """Admit by `access`, no more often than `rates` allow; refusals go to the audit log."""
        self._access = access
        self._audit = audit
        self._rates = rates

    def needs(
        self, role: Role = Role.VIEWER, scope: Scope | None = None
    ) -> Callable[[Request], Principal]:
        """A dependency that admits requests of at least this role and scope."""

        def admitted(request: Request) -> Principal:
            action = f"{request.method} {request.url.path}"
            return self._admitted(request.headers, request.client, action, role, scope)

        return admitted

    async def websocket(
        self, socket: WebSocket, scope: Scope | None = None, role: Role = Role.VIEWER
    ) -> Principal:
        """Admit a WebSocket; raises RefusedError."""
        action = f"WS {socket.url.path}"
        return await asyncio.to_thread(
            self._admitted, socket.headers, socket.client, action, role, scope
        )

    def _admitted(
        self, headers: Any, client: Any, action: str, role: Role, scope: Scope | None  # noqa: ANN401
    ) -> Principal:
        address = client.host if client is not None else ""
        kind, _, token = headers.get("authorization", "").partition(" ")
        principal: Principal | None = None
        try:
            principal = self._access.of(token.strip() if kind.lower() == "bearer" else "", address)
            self._rates.admit(principal.account)
            require(principal, role, scope)
        except RefusedError as error:
            self._audit.write(
                principal,
                action,
                text=str(error),
                accepted=False,
                address=address,
                required=False,
            )
            raise
        return principal


def register_refusals(app: FastAPI) -> None:
    """Word every refusal as `RefusalOut`."""
    app.add_exception_handler(RefusedError, _refused)
    app.add_exception_handler(StoreError, _unavailable)
    app.add_exception_handler(AeroDaaSError, _unprocessable)
    app.add_exception_handler(RequestValidationError, _malformed)
    app.add_exception_handler(HTTPException, _failed)


def _refusal(status: int, text: str, headers: dict[str, str] | None = None) -> JSONResponse:
    return JSONResponse(RefusalOut(text=text).model_dump(), status, headers)


def _refused(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RefusedError)  # noqa: S101 - registered for it alone
    headers = {"WWW-Authenticate": "Bearer"} if error.status == 401 else {}  # noqa: PLR2004
    if error.retry_after:
        headers["Retry-After"] = str(math.ceil(error.retry_after))
    return _refusal(error.status, str(error), headers)


def _unavailable(_: Request, error: Exception) -> JSONResponse:
    return _refusal(_UNAVAILABLE, f"the service's database cannot be used: {error}")


def _unprocessable(_: Request, error: Exception) -> JSONResponse:
    return _refusal(_UNPROCESSABLE, str(error))


def _malformed(_: Request, error: Exception) -> JSONResponse:
    """Tell each wrong field and its place, without the input, which may hold NaN or secrets."""
    assert isinstance(error, RequestValidationError)  # noqa: S101 - registered for it alone
    problems = error.errors()
    invalid = any(problem["type"] == "json_invalid" for problem in problems)
    said = [f"{'.'.join(map(str, problem['loc'][1:]))}: {problem['msg']}" for problem in problems]
    return _refusal(400 if invalid else _UNPROCESSABLE, "; ".join(said)[:2000])


def _failed(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)  # noqa: S101 - registered for it alone
    return _refusal(error.status_code, str(error.detail))


async def close_refused(socket: WebSocket, error: Exception) -> None:
    """Refuse a WebSocket before it is accepted."""
    reason = str(error).encode()[:_MOST_TEXT].decode(errors="ignore")
    await socket.close(_POLICY_VIOLATION, reason)

"""How refusals are worded: one model, whatever refuses."""

from __future__ import annotations

import math
from http import HTTPStatus

from fastapi import FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from aerodaas.protocol.schemas import RefusalOut
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.types.errors import AeroDaaSError

__all__ = ["close_refused", "refusal_of", "register_refusals"]

_POLICY_VIOLATION = 1008
_CLOSING_REASON = 120
"""Bytes of a WebSocket's closing reason, of 123 (RFC 6455)."""
_LONGEST = 2000


def register_refusals(app: FastAPI) -> None:
    """Word every refusal as `RefusalOut`."""
    for kind in (AeroDaaSError, RequestValidationError, HTTPException):
        app.add_exception_handler(kind, _handled)


def refusal_of(error: Exception) -> JSONResponse:
    """The answer to a request that is refused or has failed."""
    status, text, headers = int(HTTPStatus.UNPROCESSABLE_ENTITY), str(error), {}
    if isinstance(error, RefusedError):
        status = error.status
        if status == HTTPStatus.UNAUTHORIZED:
            headers["WWW-Authenticate"] = "Bearer"
        if error.retry_after is not None:
            headers["Retry-After"] = str(math.ceil(error.retry_after))
    elif isinstance(error, StoreError):
        status = int(HTTPStatus.SERVICE_UNAVAILABLE)
        text = f"the service's database cannot be used: {error}"
    elif isinstance(error, RequestValidationError):
        status, text = _malformed(error)
    elif isinstance(error, HTTPException):
        status, text = error.status_code, str(error.detail)
    return JSONResponse(RefusalOut(text=text[:_LONGEST]).model_dump(), status, headers)


async def close_refused(socket: WebSocket, error: Exception) -> None:
    """Refuse a WebSocket before it is accepted."""
    reason = str(error).encode()[:_CLOSING_REASON].decode(errors="ignore")
    await socket.close(_POLICY_VIOLATION, reason)


def _handled(_: Request, error: Exception) -> JSONResponse:
    return refusal_of(error)


def _malformed(error: RequestValidationError) -> tuple[int, str]:
    """Each wrong field and its place, without the input, which may hold NaN or secrets."""
    problems = error.errors()
    invalid = any(problem["type"] == "json_invalid" for problem in problems)
    status = HTTPStatus.BAD_REQUEST if invalid else HTTPStatus.UNPROCESSABLE_ENTITY
    said = (f"{'.'.join(map(str, one['loc'][1:]))}: {one['msg']}" for one in problems)
    return int(status), "; ".join(said)

"""How refusals are worded: one model, whatever refuses."""

from __future__ import annotations

import math
from http import HTTPStatus

from fastapi import FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from aerodaas.analytics.remote.denial import deny, malformed
from aerodaas.protocol.schemas import RefusalOut
from aerodaas.service.errors import RefusedError, StoreError
from aerodaas.types.errors import AeroDaaSError

__all__ = ["refuse", "register_refusals"]

_LONGEST = 2000


def register_refusals(app: FastAPI) -> None:
    """Word every refusal as `RefusalOut`."""
    for kind in (AeroDaaSError, RequestValidationError, HTTPException):
        app.add_exception_handler(kind, _handled)
    app.add_exception_handler(WebSocketRequestValidationError, _handled_socket)


async def refuse(scope: Scope, send: Send, error: Exception) -> None:
    """Refuse a request, or a WebSocket that is not accepted yet, with its status and reason."""
    status, text, pause = int(HTTPStatus.UNPROCESSABLE_ENTITY), str(error), None
    if isinstance(error, RefusedError):
        status = error.status
        if error.retry_after is not None:
            pause = math.ceil(error.retry_after)
    elif isinstance(error, StoreError):
        status = int(HTTPStatus.SERVICE_UNAVAILABLE)
        text = f"the service's database cannot be used: {error}"
    elif isinstance(error, RequestValidationError | WebSocketRequestValidationError):
        status, text = malformed(error.errors())
    elif isinstance(error, HTTPException):
        status, text = error.status_code, str(error.detail)
    await deny(scope, send, status, RefusalOut(text=text[:_LONGEST]).model_dump(), pause=pause)


class _Refusal(Response):
    """Answer to a request that is refused or has failed."""

    def __init__(self, error: Exception) -> None:
        super().__init__()
        self._error = error

    async def __call__(self, scope: Scope, _: Receive, send: Send) -> None:
        await refuse(scope, send, self._error)


def _handled(_: Request, error: Exception) -> Response:
    return _Refusal(error)


async def _handled_socket(socket: WebSocket, error: Exception) -> None:
    await refuse(socket.scope, socket.send, error)

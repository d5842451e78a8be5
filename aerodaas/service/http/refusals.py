"""How refusals are worded: one model, whatever refuses."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, WebSocket
from fastapi.exceptions import RequestValidationError, WebSocketRequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope, Send

from aerodaas.errors import AeroDaaSError, MissionError, SilentError
from aerodaas.http_server.denial import deny
from aerodaas.protocol.schemas import RefusalOut
from aerodaas.service.errors import RefusedError, StoreError, without_folders

__all__ = ["REFUSALS", "refuse", "register_refusals"]

_log = logging.getLogger(__name__)
_LONGEST = 2000
_LOG_SECONDS = 60.0
"""Least seconds between two words in the log that the database cannot be used."""
REFUSALS: dict[int | str, dict[str, Any]] = {
    int(status): {"model": RefusalOut, "description": status.phrase}
    for status in (
        HTTPStatus.BAD_REQUEST,
        HTTPStatus.UNAUTHORIZED,
        HTTPStatus.FORBIDDEN,
        HTTPStatus.NOT_FOUND,
        HTTPStatus.CONFLICT,
        HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
        HTTPStatus.UNPROCESSABLE_ENTITY,
        HTTPStatus.TOO_MANY_REQUESTS,
        HTTPStatus.SERVICE_UNAVAILABLE,
        HTTPStatus.GATEWAY_TIMEOUT,
        HTTPStatus.INSUFFICIENT_STORAGE,
    )
}
"""Refusals of each route, as its schema names them."""
_logged_at = -_LOG_SECONDS


def register_refusals(app: FastAPI) -> None:
    """Word every refusal as `RefusalOut`."""
    for kind in (AeroDaaSError, RequestValidationError, HTTPException):
        app.add_exception_handler(kind, _handled)
    app.add_exception_handler(WebSocketRequestValidationError, _handled_socket)


async def refuse(scope: Scope, send: Send, error: Exception) -> None:
    """Refuse a request, or a WebSocket that is not accepted yet, with its status and reason.

    Args:
        scope: ASGI's scope of the request.
        send: ASGI's channel to its sender.
        error: Why, which decides the status.
    """
    status, text, pause = int(HTTPStatus.UNPROCESSABLE_ENTITY), str(error), None
    if isinstance(error, RefusedError):
        status = error.status
        if error.retry_after is not None:
            pause = math.ceil(error.retry_after)
    elif isinstance(error, StoreError):
        status = int(HTTPStatus.SERVICE_UNAVAILABLE)
        text = "the service's database cannot be used: ask again later; its log says why"
        _log_failure(error)
    elif isinstance(error, MissionError):
        silent = isinstance(error, SilentError)
        status = int(HTTPStatus.GATEWAY_TIMEOUT if silent else HTTPStatus.CONFLICT)
    elif isinstance(error, RequestValidationError | WebSocketRequestValidationError):
        status, text = _malformed(error.errors())
    elif isinstance(error, HTTPException):
        status, text = error.status_code, str(error.detail)
    await deny(
        scope,
        send,
        status,
        RefusalOut(text=without_folders(text)[:_LONGEST]).model_dump(),
        pause=pause,
    )


def _malformed(problems: Sequence[Mapping[str, Any]]) -> tuple[int, str]:
    """Status and text for a request that is not as its schema has it; `problems` are pydantic's.

    Each wrong field and its place, without the input, which may hold NaN or secrets.
    """
    invalid = any(problem["type"] == "json_invalid" for problem in problems)
    status = HTTPStatus.BAD_REQUEST if invalid else HTTPStatus.UNPROCESSABLE_ENTITY
    said = (f"{_place(problem['loc'])}: {problem['msg']}" for problem in problems)
    return int(status), "; ".join(said)


def _place(location: tuple[int | str, ...]) -> str:
    return ".".join(map(str, location[1:])) or str(location[0])


def _log_failure(error: StoreError) -> None:
    """Tell the provider's people alone what is wrong with the database, and where it is."""
    global _logged_at  # noqa: PLW0603 - one log for all that are refused
    now = time.monotonic()
    if now - _logged_at >= _LOG_SECONDS:
        _logged_at = now
        _log.warning("requests are refused: %s", error)


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

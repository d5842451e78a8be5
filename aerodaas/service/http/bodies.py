"""Bodies of requests: parsed beside the event loop, one at a time, and bounded by what it costs."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Coroutine
from concurrent.futures import ThreadPoolExecutor
from http import HTTPStatus
from typing import Any

from fastapi import APIRouter, Request, Response, Security
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from fastapi.security import HTTPBearer
from pydantic import TypeAdapter, ValidationError

from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.http.refusals import REFUSALS

__all__ = ["api_router"]

_SMALL = 1 << 10
"""Bytes of a body that is parsed at once: a command waits for nobody's document."""
_parsing = ThreadPoolExecutor(1, "parsing")


def api_router(prefix: str, tag: str) -> APIRouter:
    """Make a router of HTTP routes whose bodies are bounded.

    Args:
        prefix: Path below which they lie.
        tag: Tag of the routes in the schema.
    """
    return APIRouter(
        prefix=prefix,
        tags=[tag],
        route_class=_BoundedRoute,
        # The gate has looked at the token by then; this tells the schema's readers of it.
        dependencies=[Security(HTTPBearer(auto_error=False))],
        responses=REFUSALS,
    )


class _BoundedRoute(APIRoute):
    """Route whose body, unless it is small, keeps no other request waiting while it is parsed."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Parse the body, then handle the request."""
        handle = super().get_route_handler()
        if self.body_field is None:
            return handle
        model: TypeAdapter[Any] = TypeAdapter(self.body_field.field_info.annotation or Any)

        async def bounded(request: Request) -> Response:
            parsed = _Parsed(request.scope, request.receive)
            body = await parsed.body()
            if len(body) > _SMALL and "json" in request.headers.get("content-type", ""):
                loop = asyncio.get_running_loop()
                parsed.content = await loop.run_in_executor(_parsing, _content, model, body)
            return await handle(parsed)

        return bounded


class _Parsed(Request):
    """Request whose body may have been parsed."""

    content: Any = None

    async def json(self) -> Any:  # noqa: ANN401 - the base's
        return await super().json() if self.content is None else self.content


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object with few enough keys: unknown ones are refused one by one, which takes long."""
    if len(pairs) > RequestLimits.object_keys:
        raise RefusedError(
            int(HTTPStatus.UNPROCESSABLE_ENTITY),
            f"an object has at most {RequestLimits.object_keys} keys",
        )
    return dict(pairs)


def _content(model: TypeAdapter[Any], body: bytes) -> Any:  # noqa: ANN401 - the model's
    """Content of a body; raises RequestValidationError, and RefusedError for one beyond limits."""
    values = max(body.count(b","), body.count(b":"))
    groups = body.count(b"{") + body.count(b"[")
    limits = RequestLimits
    most = min(limits.body_values, limits.group_values * groups)
    if values > max(limits.few_values, most) or groups > limits.body_groups:
        raise RefusedError(
            int(HTTPStatus.REQUEST_ENTITY_TOO_LARGE),
            f"a body has at most {limits.body_values} values, {limits.body_groups} lists and "
            f"objects, and {limits.group_values} values in each of these on average",
        )
    try:
        return model.validate_python(json.loads(body, object_pairs_hook=_object))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        said = {"type": "json_invalid", "loc": ("body",), "msg": f"no JSON: {error}"}
        raise RequestValidationError([said]) from None
    except RecursionError:
        raise RefusedError(int(HTTPStatus.BAD_REQUEST), "the body is nested too deeply") from None
    except ValidationError as error:
        if error.error_count() > RequestLimits.body_errors:
            raise RefusedError(
                int(HTTPStatus.UNPROCESSABLE_ENTITY),
                f"{error.error_count()} values of the body are not as the schema has them: GET "
                "/v1/openapi.json",
            ) from None
        found = error.errors(include_url=False, include_input=False)
        raise RequestValidationError(
            [{**one, "loc": ("body", *one["loc"])} for one in found]
        ) from None

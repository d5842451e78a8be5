"""Each limit of a JSON body: as much as it says is taken, and one more is refused."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest
from fastapi import FastAPI

from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.http.refusals import register_refusals

GROUPS = 2000


def _take_lists(body: list[list[int]]) -> int:
    return len(body)


def _take_object(body: dict[str, Any]) -> int:
    return len(body)


def posted(path: str, body: object) -> httpx.Response:
    """Answer of an application that takes lists and objects."""
    router = api_router("/v1", "bodies")
    router.add_api_route("/lists", _take_lists, methods=["POST"])
    router.add_api_route("/object", _take_object, methods=["POST"])
    app = FastAPI()
    register_refusals(app)
    app.include_router(router)

    async def post() -> httpx.Response:
        transport = httpx.ASGITransport(app)
        async with httpx.AsyncClient(transport=transport, base_url="http://bodies") as client:
            return await client.post(path, json=body)

    return asyncio.run(post())


@pytest.mark.parametrize("extra", [0, 1])
def test_a_body_has_so_many_values(extra: int) -> None:
    """However many lists they stand in."""
    values = RequestLimits.body_values // GROUPS
    lists = [[0] * values for _ in range(GROUPS)]
    lists[0] += [0] * extra * GROUPS
    assert posted("/v1/lists", lists).status_code == (413 if extra else 200)


@pytest.mark.parametrize("extra", [0, 1])
def test_an_object_has_so_many_keys(extra: int) -> None:
    """Also where any key is allowed."""
    body = {f"key{number}": 0 for number in range(RequestLimits.object_keys + extra)}
    assert posted("/v1/object", body).status_code == (422 if extra else 200)


@pytest.mark.parametrize("extra", [0, 1])
def test_so_many_errors_are_worded(extra: int) -> None:
    """More of them are counted only."""
    errors = RequestLimits.body_errors + extra
    answer = posted("/v1/lists", [["no number"] * errors])
    assert answer.status_code == 422
    assert (f"{errors} values" in answer.text) == bool(extra)

"""Playback of recorded missions."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from typing import Annotated, Any, TypeAlias

from fastapi import APIRouter, Query, Request, Response

from aerodaas.protocol.schemas import Role, Scope
from aerodaas.service.access.principal import Principal
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission
from aerodaas.service.live.playback import Player

__all__ = ["PlaybackRoutes"]

_LONG = 10_000
"""Bytes of an answer from which on it is compressed."""
_Moment: TypeAlias = Annotated[int, Query(ge=0, le=10**18)]
"""Mission nanoseconds."""
_Stream: TypeAlias = Annotated[str, Query(max_length=4096)]
"""Name of a stream of pictures."""


class PlaybackRoutes:
    """Routes `/v1/missions/{id}/playback` and `/v1/missions/{id}/playback/picture`."""

    def __init__(self, player: Callable[[Principal, str], Player], admission: Admission) -> None:
        """Answer from a mission's `player`, which raises RefusedError without a recording."""
        self._player = player
        self._admission = admission

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1/missions", "missions")
        bare: dict[str, Any] = {"response_model": None}
        router.add_api_route("/{mission}/playback", self.playback, **bare)
        router.add_api_route("/{mission}/playback/picture", self.picture, **bare)
        return router

    def playback(self, mission: str, request: Request) -> Response:
        """The recorded flight as a page plays it, once it is over; how far it has been read."""
        text = self._of(mission, request).text
        headers = {"Vary": "Accept-Encoding"}
        # A flight of minutes takes megabytes, of which nine tenths repeat one another.
        if len(text) > _LONG and "gzip" in request.headers.get("Accept-Encoding", ""):
            text = gzip.compress(text, compresslevel=1)
            headers["Content-Encoding"] = "gzip"
        return Response(text, media_type="application/json", headers=headers)

    def picture(
        self,
        mission: str,
        request: Request,
        stream: _Stream,
        at: _Moment,
        depth: bool = False,  # noqa: FBT001, FBT002 - of an address
    ) -> Response:
        """The last picture of a stream captured at or before a mission time, in nanoseconds.

        One line of JSON with what was found in it and the picture's header; after it its depth as a
        PNG, if wanted and measured, and a JPEG.
        """
        content = self._of(mission, request).picture(stream, at, depth=depth)
        return Response(content, media_type="application/octet-stream")

    def _of(self, mission: str, request: Request) -> Player:
        principal = self._admission.require(request, Role.VIEWER, Scope.SENSE, agents=True)
        return self._player(principal, mission)

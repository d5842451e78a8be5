"""A map in one file: a PMTiles archive of pictures, which the page reads by parts.

The header is that of version 3 of the format, https://github.com/protomaps/PMTiles/blob/main/spec.
The service reads it before it serves the first page, so that a file which is no map of pictures is
refused at once. The viewer's browser unpacks the rest.
"""

from __future__ import annotations

from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse

from aerodaas.config.sections.place import MapTilesConfig
from aerodaas.errors import ConfigError
from aerodaas.protocol.scenery import ARCHIVE_PATH

__all__ = ["archive_routes", "require_pictures"]

_MAGIC = b"PMTiles\3"
"""The format's name and version."""
_HEADER_BYTES = 127
_KIND_AT = 99
"""Place of the byte that tells what the tiles are."""
_PICTURES = frozenset({2, 3, 4, 5})
"""PNG, JPEG, WebP and AVIF."""


def archive_routes(tiles: MapTilesConfig | None) -> APIRouter:
    """The route of a local archive, for whom the guard lets in; none without one.

    Raises ConfigError if the file is no archive of pictures.
    """
    router = APIRouter()
    if tiles is not None and (path := tiles.file) is not None:
        require_pictures(path)

        def send() -> FileResponse:
            return FileResponse(path, media_type="application/octet-stream")

        router.add_api_route(
            ARCHIVE_PATH, send, response_class=FileResponse, include_in_schema=False
        )
    return router


def require_pictures(path: Path) -> None:
    """Raise ConfigError, with the remedy, unless a file is a PMTiles archive of pictures."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEADER_BYTES)
    except OSError as error:
        raise ConfigError(
            f"cannot read the map {path}: {error.strerror}; see map_tiles.url"
        ) from None
    if len(head) < _HEADER_BYTES or not head.startswith(_MAGIC):
        raise ConfigError(f"{path} is no PMTiles archive of version 3; see map_tiles.url")
    if head[_KIND_AT] not in _PICTURES:
        raise ConfigError(
            f"{path} holds no pictures, which alone the map draws: take an archive of pictures "
            "(PNG, JPEG, WebP or AVIF), or render them, as TileServer GL does"
        )

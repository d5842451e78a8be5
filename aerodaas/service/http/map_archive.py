"""A map in one file: a PMTiles archive of pictures, which the page reads by parts.

The header is that of version 3 of the format, https://github.com/protomaps/PMTiles/blob/main/spec.
It is looked at before the first page is served, so that a file which is no map of pictures is told
at once; what lies in it is unpacked by the viewer's browser.
"""

from __future__ import annotations

import gzip
import os
import struct
import zlib
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse

from aerodaas.config.sections.map_tiles import MapTilesConfig
from aerodaas.errors import ConfigError
from aerodaas.protocol.scenery import ARCHIVE_PATH

__all__ = ["archive_routes", "require_pictures"]

_MAGIC, _VERSION = b"PMTiles", 3
_HEADER = struct.Struct("<7sB8Q24xx3B")
"""Magic, version, places and lengths of four parts, compressions, and what the tiles are."""
_HEADER_BYTES = 127
_PICTURES = frozenset({2, 3, 4, 5})
"""PNG, JPEG, WebP and AVIF."""
_VECTORS = frozenset({1, 6})
"""Mapbox Vector Tiles and MapLibre Tiles."""
_PLAIN, _GZIP = 1, 2
_MOST_ROOT = 16_384 - _HEADER_BYTES
"""Bytes of the root directory, by the format."""


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
    """Raise ConfigError, with the remedy, unless a file is a whole PMTiles archive of pictures."""
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            head = file.read(_HEADER_BYTES)
            if len(head) < _HEADER_BYTES or not head.startswith(_MAGIC):
                raise ConfigError(f"{path} is no PMTiles archive; see map_tiles.url")
            _, version, *places, packing, _, kind = _HEADER.unpack_from(head)
            root, root_size = places[:2]
            file.seek(min(root, size))
            directory = file.read(min(root_size, _MOST_ROOT))
    except OSError as error:
        raise ConfigError(
            f"cannot read the map {path}: {error.strerror}; see map_tiles.url"
        ) from None
    if version != _VERSION:
        raise ConfigError(
            f"{path} is a PMTiles archive of version {version}, not {_VERSION}: convert it by "
            "`pmtiles convert`"
        )
    if kind not in _PICTURES:
        what = "vectors" if kind in _VECTORS else "unknown tiles"
        raise ConfigError(
            f"{path} holds {what}, which the map does not draw: take an archive of pictures (PNG, "
            "JPEG, WebP or AVIF), or render them, as TileServer GL does"
        )
    if max(start + long for start, long in zip(places[::2], places[1::2], strict=True)) > size:
        raise ConfigError(f"{path} is cut off after {size} bytes: copy or download it again")
    try:
        if packing == _GZIP:
            gzip.decompress(directory)
        elif packing != _PLAIN:
            raise ConfigError(
                f"the directories of {path} are packed by something else than gzip: convert it by "
                "`pmtiles convert`"
            )
    except (OSError, EOFError, zlib.error):
        raise ConfigError(f"{path} is damaged: copy or download it again") from None

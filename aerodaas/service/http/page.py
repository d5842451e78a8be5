"""The page itself: files that ship built, under a policy that admits nothing else."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fastapi import APIRouter
from fastapi.responses import FileResponse

from aerodaas.config.sections.place import MapTilesConfig

__all__ = ["PAGE_PATHS", "page_routes"]

_FOLDER = Path(__file__).parent / "page"
_FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/console.js": ("console.js", "text/javascript; charset=utf-8"),
    "/icon.svg": ("icon.svg", "image/svg+xml"),
    "/console.css": ("console.css", "text/css; charset=utf-8"),
}
PAGE_PATHS = frozenset(_FILES)
"""Paths of the page's own files, which hold no secret."""
_HEADERS = {
    # Nothing from elsewhere, no inline script or style, and in nobody's frame unless asked for.
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:{tiles}; "
        "connect-src 'self'{archive}; base-uri 'none'; form-action 'none'; "
        "frame-ancestors {ancestors}"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-cache",
}
_NOBODY = "'none'"
_NOTEBOOKS = "http://127.0.0.1:* http://localhost:*"
"""Pages that may hold the console in a frame of theirs, where a notebook asked for it."""


def page_routes(*, framed: bool = False, tiles: MapTilesConfig | None = None) -> APIRouter:
    """Routes of the page's files.

    Args:
        framed: Pages of this machine may hold them in a frame.
        tiles: Pictures may come from their server, too, or parts of an archive.
    """
    router = APIRouter()
    origin = "" if tiles is None or not tiles.origin else f" {tiles.origin}"
    archive = tiles is not None and tiles.is_archive
    given = {
        "ancestors": _NOTEBOOKS if framed else _NOBODY,
        "tiles": "" if archive else origin,
        "archive": origin if archive else "",
    }
    headers = {key: value.format(**given) for key, value in _HEADERS.items()}
    for path, (name, kind) in _FILES.items():
        router.add_api_route(
            path, _sender(name, kind, headers), response_class=FileResponse, include_in_schema=False
        )
    return router


def _sender(name: str, kind: str, headers: dict[str, str]) -> Callable[[], FileResponse]:
    def send() -> FileResponse:
        return FileResponse(_FOLDER / name, media_type=kind, headers=headers)

    return send

"""Tiles of a map of the Earth, which the console lays below the flight."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import Field, field_validator

from aerodaas.config.checked import Strict

__all__ = ["MapTilesConfig"]

_LOOPBACK = frozenset({"127.0.0.1", "::1", "localhost"})
_PLACES = ("{z}", "{x}", "{y}")
_ARCHIVE = ".pmtiles"


class MapTilesConfig(Strict):
    """Pictures of 256 x 256 pixels in Web Mercator, as most servers of maps have them.

    Whoever opens the console fetches them from there, so that the server learns where is flown. An
    archive that is a file comes from the console itself.
    """

    url: str
    """Address with `{z}`, `{x}` and `{y}`: https, or http on the viewer's own machine; or that of
    an archive, whose name ends in `.pmtiles`, or its path."""
    attribution: Annotated[str, Field(max_length=200)] = ""
    """Whose map it is, shown on it, as most licences ask."""
    max_zoom: Annotated[int, Field(ge=0, le=24)] = 19
    """The finest level that the server has."""

    @field_validator("url")
    @classmethod
    def _is_template(cls, url: str) -> str:
        parts = urlsplit(url)
        archive = parts.path.endswith(_ARCHIVE)
        if archive and not parts.scheme and not parts.netloc:
            return url
        missing = [place for place in _PLACES if url.count(place) != 1]
        if archive and len(missing) < len(_PLACES):
            raise ValueError("an archive of tiles is one file, without {z}, {x} and {y}")
        if missing and not archive:
            raise ValueError(
                f"an address of tiles has {', '.join(missing)} once, or it is that of an archive "
                f"and ends in {_ARCHIVE}"
            )
        local = parts.scheme == "http" and parts.hostname in _LOOPBACK
        if not parts.hostname or not (parts.scheme == "https" or local):
            raise ValueError("tiles come by https, or by http from this machine")
        if any(one in parts.netloc for one in "{}@ ;,'\"") or not url.isprintable():
            raise ValueError("the host of tiles is a plain one, without user or placeholder")
        return url

    @property
    def is_archive(self) -> bool:
        """Whether it is one PMTiles archive, not an address for each tile."""
        return urlsplit(self.url).path.endswith(_ARCHIVE)

    @property
    def file(self) -> Path | None:
        """Path of an archive that is a file; None for what is fetched from elsewhere."""
        return None if urlsplit(self.url).netloc else Path(self.url)

    @property
    def origin(self) -> str:
        """Scheme, host and port, for a policy that admits what is there; empty for a file."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc}" if parts.netloc else ""

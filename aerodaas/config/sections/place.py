"""Where the environment lies on the Earth: its home, the map below it, and the ground."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from urllib.parse import urlsplit

from pydantic import Field, field_validator

from aerodaas.config.checked import Finite, Positive, Strict

if TYPE_CHECKING:
    from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["HomeConfig", "MapTilesConfig", "TerrainConfig"]


class HomeConfig(Strict):
    """Where the local ENU frame is pinned on WGS84: degrees and metres."""

    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=180)]
    altitude: Finite = 0.0
    """Above the ellipsoid, as GPS counts."""
    above_sea: Finite | None = None
    """The same place above mean sea level, for waypoints that are; None: as the vehicle says."""

    @property
    def origin(self) -> GeodeticOrigin:
        """The origin of the local ENU frame."""
        # Reading an environment file needs no numpy.
        from aerodaas.geometry.frames import GeodeticOrigin  # noqa: PLC0415

        return GeodeticOrigin(self.latitude, self.longitude, self.altitude)


class TerrainConfig(Strict):
    """The ground around home. Drones keep away from it, and never fly where it is not known."""

    files: Annotated[list[str], Field(min_length=1, max_length=400)]
    """SRTM's `.hgt` or GeoTIFF (EPSG:4326), metres above the sea; they lie where drones are flown
    from, too."""
    clearance: Positive = 5.0
    """Metres kept above the ground in flight, from the end of the take-off to the landing."""

    def check(self, robot: str, takeoff_height: float) -> None:
        """Refuse a take-off that would end too near to the ground.

        Args:
            robot: Id of the robot, for the error.
            takeoff_height: Metres, the robot's `limits.takeoff_height`.

        Raises:
            ValueError: If it is less than `clearance`.
        """
        if takeoff_height < self.clearance:
            message = (
                f"{robot}: limits.takeoff_height ({takeoff_height:g} m) must be at least "
                f"terrain.clearance ({self.clearance:g} m): raise the one or lower the other"
            )
            raise ValueError(message)


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

"""Where the environment lies on the Earth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from aerodaas.config.checked import Finite, Strict

if TYPE_CHECKING:
    from aerodaas.geometry.frames import GeodeticOrigin

__all__ = ["HomeConfig"]


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

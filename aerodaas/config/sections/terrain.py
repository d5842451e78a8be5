"""Settings of the terrain: elevation files, and how near to the ground a drone may come."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from aerodaas.config.checked import Positive, Strict

__all__ = ["TerrainConfig"]


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

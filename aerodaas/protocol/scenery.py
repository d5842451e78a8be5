"""What lies below a flight on the map: the simulated world, or tiles of the Earth."""

from __future__ import annotations

from pydantic import Field

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.sections.robot import RobotConfig
from aerodaas.protocol.base import AnswerModel
from aerodaas.simulation.ground_plan import Shape, ground_plan
from aerodaas.simulation.world import World

__all__ = ["ARCHIVE_PATH", "SceneryOut", "TilesOut"]

ARCHIVE_PATH = "/v1/map.pmtiles"
"""Where the page finds an archive of tiles that is a file."""


class TilesOut(AnswerModel):
    """Tiles of the Earth, and where the local frame lies on it."""

    url: str
    """Address with `{z}`, `{x}` and `{y}`, or of an archive."""
    archive: bool
    """Whether it is that of one PMTiles archive."""
    attribution: str
    max_zoom: int
    latitude: float
    """Of the local frame's origin, degrees."""
    longitude: float


class SceneryOut(AnswerModel):
    """Scenery that the map draws below a flight; empty where nothing is known."""

    shapes: list[Shape] = Field(default_factory=list)
    tiles: TilesOut | None = None

    @classmethod
    def of(cls, config: EnvironmentConfig, seed: int | None = None) -> SceneryOut:
        """The scenery of an environment; a simulated world's where all of its drones are simulated.

        Args:
            config: The environment.
            seed: Of the flight; None for the environment's own.

        Raises:
            ConfigError: If its world cannot be read.
        """
        return cls(shapes=_shapes(config, seed), tiles=_tiles(config))


def _shapes(config: EnvironmentConfig, seed: int | None) -> list[Shape]:
    if not all(map(_simulated, config.robots)):
        return []
    chosen = {} if seed is None else {"seed": seed}
    world = World.load(config.simulation.model_copy(update=chosen))
    return ground_plan(world)


def _simulated(robot: RobotConfig) -> bool:
    return robot.driver == "simulated"


def _tiles(config: EnvironmentConfig) -> TilesOut | None:
    tiles, home = config.map_tiles, config.home
    if tiles is None or home is None:
        return None
    return TilesOut(
        url=tiles.url if tiles.file is None else ARCHIVE_PATH.removeprefix("/"),
        archive=tiles.is_archive,
        attribution=tiles.attribution,
        max_zoom=tiles.max_zoom,
        latitude=home.latitude,
        longitude=home.longitude,
    )

"""The environment file: robots, sensors, compute resources, schedulers, recording.

`EnvironmentConfig.load` reads `environment.json`; its JSON schema is printed by
`aerodaas schema`. Lengths are metres, speeds m/s, angles degrees (people write these files),
rates Hz, times seconds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import ConfigDict, Field, SecretStr, field_serializer, model_validator
from typing_extensions import Self

from aerodaas.config.checked import (
    Extensible,
    Finite,
    NotNegative,
    Positive,
    Strict,
    checked,
)
from aerodaas.config.extensions import SettingsSection
from aerodaas.config.sections.actuators import (
    GripperConfig,
    ParachuteConfig,
    RelayConfig,
    ServoConfig,
)
from aerodaas.config.sections.compute import ComputeConfig, EndpointConfig, RuntimeEnvConfig
from aerodaas.config.sections.place import HomeConfig, MapTilesConfig, TerrainConfig
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.config.sections.robot import (
    CameraConfig,
    GeofenceConfig,
    GimbalConfig,
    LimitsConfig,
    MissionConfig,
    RobotConfig,
    SensorConfig,
)
from aerodaas.identifiers import Identifier, ScopedName
from aerodaas.text.json_text import check_plain, read_json

__all__ = [
    "CameraConfig",
    "ComputeConfig",
    "EndpointConfig",
    "EnvironmentConfig",
    "GeofenceConfig",
    "GimbalConfig",
    "GripperConfig",
    "HomeConfig",
    "LimitsConfig",
    "MissionConfig",
    "ParachuteConfig",
    "PreflightConfig",
    "RecordingConfig",
    "RelayConfig",
    "RemoteConfig",
    "RobotConfig",
    "RuntimeEnvConfig",
    "SchedulersConfig",
    "SensorConfig",
    "ServoConfig",
    "SimulationConfig",
    "TaskConfig",
    "TenantConfig",
    "TerrainConfig",
    "as_runtime_env",
    "validated",
]


class TaskConfig(Strict):
    """Task of one analysis for an analytics scheduler; times in milliseconds.

    Benefit and costs are in one unit of the user's choice.
    """

    benefit: Positive = 1.0
    """Worth of a result in time."""
    deadline: Positive = 1000.0
    """From the frame's arrival at the dispatcher."""
    edge_time: Positive | None = None
    """Expected execution on the edge; None: measured, 100 until then."""
    cloud_time: Positive | None = None
    """Expected time from sending a frame to the cloud until its result is back.

    None: measured, 300 until then.
    """
    edge_cost: NotNegative = 0.0
    """Cost of one execution on the edge."""
    cloud_cost: NotNegative = 0.0
    """Cost of one execution in the cloud."""
    qoe_bonus: NotNegative = 0.0
    """Worth of a window in which enough results come in time; 0 for none."""
    qoe_share: Annotated[float, Field(gt=0, le=1)] = 0.9
    """Results in time over frames, for the bonus."""
    qoe_window: Positive = 20.0
    """Length of the windows, seconds."""


class TenantConfig(Strict):
    """One tenant that shares edge and cloud with others, for the scheduler `sfq_dems`."""

    analyses: list[ScopedName] = Field(default_factory=list)
    """Its analyses, by name or `robot/analysis`; those of no tenant share the weight of one."""
    weight: Positive = 1.0
    """Its share is its weight over the sum of all tenants' that have tasks."""


class SchedulersConfig(Strict):
    """Default plug-ins: a registered name or `module:Class`."""

    trajectory: str = "ordered"
    tasks: dict[ScopedName, TaskConfig] = Field(default_factory=dict)
    """What the analytics scheduler is told of each analysis, by its name or `robot/analysis`."""
    tenants: dict[Identifier, TenantConfig] = Field(default_factory=dict)
    """Whose analyses are whose, for a scheduler that shares by tenant."""
    analytics: str | None = None
    """None: each analysis runs where it is deployed, on the newest item, without a dispatcher."""

    @model_validator(mode="after")
    def _one_tenant_each(self) -> Self:
        names = [name for tenant in self.tenants.values() for name in tenant.analyses]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            message = f"more than one tenant has {', '.join(twice)}"
            raise ValueError(message)
        return self


class RecordingConfig(Strict):
    """Settings of the MCAP recording."""

    enabled: bool = True
    path: str | None = None
    """None: a new folder under `runs/`."""
    images: Literal["jpeg", "h264", "png", "none"] = "jpeg"
    """H.264 takes a fraction of JPEG's space and more of a processor. PNG loses nothing, so that a
    replay sees what was seen; it takes several times the space."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 85
    application_source: bool = False
    """Record the application's source as well; by default its file's name and SHA-256 only."""


class RemoteConfig(Strict):
    """Where `RemoteAnalytics` listens for a remote user, and who may command."""

    host: str = "127.0.0.1"
    """Address to listen on; beyond the loopback interface a token is compulsory."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8350
    token: Annotated[SecretStr, Field(min_length=16)] | None = None
    """Secret that every request must carry; the environment variable AERODAAS_REMOTE_TOKEN takes
    its place. It is shown, logged and recorded nowhere."""

    @field_serializer("token", when_used="json")
    def _left_out(self, token: object) -> None:
        """Leave it out: asterisks in its place would be a token that everybody knows."""


class SimulationConfig(Strict):
    """The world of the simulated drones."""

    world: str = "empty"
    """A world's registered name, or the path of a scenario file."""
    seed: Annotated[int, Field(ge=0)] = 0
    wind: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    """Mean wind, ENU m/s."""
    gust: NotNegative = 0.0
    """Standard deviation of the gusts, m/s."""
    sensor_noise: NotNegative = 1.0
    """Scales the noise of the simulated odometry and GPS; 0 for none."""
    execution_times: str | None = None
    """How long tasks of an analytics scheduler take in simulated time, around the times that it is
    told: `nominal`, `lognormal:0.15` or `gamma:0.15`. None: no time at all, and without a cloud."""
    network: str = "steady"
    """Link to the cloud in simulated time: `steady`, `trapezium:400`, `outage:30-45` or
    `trace:FILE`."""
    network_period: Positive = 300.0
    """Seconds over which a network spreads that names no times of its own."""


class EnvironmentConfig(Extensible):
    """A whole environment file."""

    model_config = ConfigDict(title="AeroDaaS environment")
    section: ClassVar[SettingsSection] = "environment"

    schema_url: str | None = Field(default=None, alias="$schema")
    name: str = "environment"
    home: HomeConfig | None = None
    terrain: TerrainConfig | None = None
    map_tiles: MapTilesConfig | None = None
    robots: list[RobotConfig] = Field(min_length=1)
    sensors: list[SensorConfig] = Field(default_factory=list)
    """Sensors of the environment that no robot carries."""
    compute: list[ComputeConfig] | Literal["auto"] = "auto"
    runtime_env: dict[ScopedName, RuntimeEnvConfig] = Field(default_factory=dict)
    """By the name of an analysis, or `robot/analysis`; in the place of what `deploy` was given."""
    schedulers: SchedulersConfig = SchedulersConfig()
    recording: RecordingConfig = RecordingConfig()
    remote: RemoteConfig = RemoteConfig()
    simulation: SimulationConfig = SimulationConfig()

    @model_validator(mode="after")
    def _unique_ids(self) -> Self:
        groups = {
            "robot": [robot.id for robot in self.robots],
            "environment sensor": [sensor.id for sensor in self.sensors],
            **{f"sensor of {one.id}": [s.id for s in one.sensors] for one in self.robots},
            **{f"actuator of {one.id}": [a.id for a in one.actuators] for one in self.robots},
            "compute resource": [] if self.compute == "auto" else [c.id for c in self.compute],
        }
        for kind, ids in groups.items():
            twice = sorted({name for name in ids if ids.count(name) > 1})
            if twice:
                message = f"more than one {kind} is called {', '.join(twice)}"
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _on_the_map(self) -> Self:
        if self.map_tiles is not None and self.home is None:
            message = "map_tiles lie around home: give a home with latitude and longitude"
            raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _over_ground(self) -> Self:
        if self.terrain is not None:
            if self.home is None:
                message = "a terrain lies around home: give a home with latitude and longitude"
                raise ValueError(message)
            for robot in self.robots:
                self.terrain.check(robot.id, robot.limits.takeoff_height)
        return self

    @model_validator(mode="after")
    def _known_edges(self) -> Self:
        known = {
            resource.id
            for resource in (() if self.compute == "auto" else self.compute)
            if resource.kind == "edge"
        }
        for robot in self.robots:
            if robot.edge is not None and robot.edge not in known:
                message = f"{robot.id}.edge: no edge under compute is called {robot.edge!r}"
                raise ValueError(message)
        return self

    def for_actors(self) -> Self:
        """The environment as a run's actors have it, without the secrets that are not for them.

        The token of the remote control and environment variables reach the analysis concerned
        alone.
        """
        remote = self.remote.model_copy(update={"token": None})
        return self.model_copy(update={"remote": remote, "runtime_env": {}, "compute": "auto"})

    def camera_driver(self, sensor: SensorConfig) -> str:
        """The driver of a camera: its own, else its robot's, else the simulated one.

        So one word in the file, a robot's driver, takes its camera along.
        """
        if sensor.driver is not None:
            return sensor.driver
        carriers = (robot.driver for robot in self.robots if robot.id == sensor.robot)
        return next(carriers, "simulated")

    def all_sensors(self) -> list[SensorConfig]:
        """The sensors of all robots and the environment's own."""
        return [*(sensor for robot in self.robots for sensor in robot.sensors), *self.sensors]

    def has_pictures(self, sensor: SensorConfig) -> bool:
        """Tell whether a camera has a source at all.

        MAVLink carries no pictures: the camera of such a robot is the stream that its `path`
        names, and without one it can only be left out.
        """
        return self.camera_driver(sensor) != "mavlink" or bool(sensor.settings.get("path"))

    @classmethod
    def load(cls, path: str | Path) -> EnvironmentConfig:
        """Read an environment file; raises ConfigError that names the file and the place."""
        return validated(read_json(path, "the environment file"), str(path))


def validated(content: object, place: str) -> EnvironmentConfig:
    """Check the content of an environment file.

    Args:
        content: Plain data.
        place: Where it stands, for the error.

    Raises:
        ConfigError: Names `place`.
    """
    check_plain(content, place)
    return checked(EnvironmentConfig, content, place, " (see `aerodaas schema`)")


def as_runtime_env(content: object, place: str) -> RuntimeEnvConfig:
    """Check what an application says of a runtime_env.

    Args:
        content: Plain data.
        place: Where it stands, for the error.

    Raises:
        ConfigError: Names `place`.
    """
    return checked(RuntimeEnvConfig, content, f"{place}: runtime_env")

"""The environment file: robots, sensors, compute resources, schedulers, recording.

`EnvironmentConfig.load` reads `environment.json`; its JSON schema is printed by
`aerodaas schema`. Lengths are metres, speeds m/s, angles degrees (people write these files),
rates Hz, times seconds.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainSerializer,
    PrivateAttr,
    SecretStr,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    field_serializer,
    model_serializer,
    model_validator,
)
from typing_extensions import Self

from aerodaas.config.checked import checked
from aerodaas.config.json_text import check_plain, read_json
from aerodaas.config.preflight import PreflightConfig
from aerodaas.config.secrets import HIDDEN, SecretUrl, shown, shown_text
from aerodaas.config.terrain import TerrainConfig
from aerodaas.types.identifiers import Identifier, ScopedName

__all__ = [
    "CameraConfig",
    "ComputeConfig",
    "EndpointConfig",
    "EnvironmentConfig",
    "GeofenceConfig",
    "HomeConfig",
    "LimitsConfig",
    "MissionConfig",
    "PreflightConfig",
    "RecordingConfig",
    "RemoteConfig",
    "RobotConfig",
    "RuntimeEnvConfig",
    "SchedulersConfig",
    "SensorConfig",
    "SimulationConfig",
    "TaskConfig",
    "TenantConfig",
    "TerrainConfig",
    "as_runtime_env",
    "validated",
]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


def _shown_settings(settings: dict[str, Any]) -> dict[str, Any]:
    return dict(shown(settings))


Settings = Annotated[dict[str, Any], PlainSerializer(_shown_settings, when_used="json")]
"""Settings of a plug-in, which may hold secrets."""


def _without_logins(value: Any) -> Any:  # noqa: ANN401 - as nested as its input
    """URLs in texts without user, password and parameters, in any setting."""
    if isinstance(value, str):
        return shown_text(value)
    if isinstance(value, list):
        return [_without_logins(one) for one in value]
    if isinstance(value, dict):
        return {key: _without_logins(one) for key, one in value.items()}
    return value


class _Strict(BaseModel):
    """Unknown keys are mistakes, not wishes.

    Neither `repr` nor JSON holds a secret; `model_dump()` keeps them, for a copy.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    @model_serializer(mode="wrap")
    def _serialized(
        self, dump: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        content: dict[str, Any] = dump(self)
        return _without_logins(content) if info.mode == "json" else content

    def __repr_args__(self) -> Iterator[tuple[str | None, Any]]:
        for name, value in super().__repr_args__():
            # Which settings of a plug-in are secrets, its own model alone knows.
            hidden = dict.fromkeys(value, HIDDEN) if name == "settings" else value
            yield name, _without_logins(hidden)


class HomeConfig(_Strict):
    """Where the local ENU frame is pinned on WGS84: degrees and metres."""

    latitude: Annotated[float, Field(ge=-90, le=90)]
    longitude: Annotated[float, Field(ge=-180, le=180)]
    altitude: Finite = 0.0
    """Above the ellipsoid, as GPS counts."""
    above_sea: Finite | None = None
    """The same place above mean sea level, for waypoints that are; None: as the vehicle says."""


class GeofenceConfig(_Strict):
    """Where the drone may be: a polygon in ENU metres, a floor and a ceiling above home."""

    polygon: list[tuple[Finite, Finite]] = Field(default_factory=list)
    """Corners (east, north); empty for no polygon."""
    floor: Finite = 0.3
    ceiling: Finite = 120.0
    margin: NotNegative = 0.5
    """Metres that the drone keeps from the polygon's edge and from no-fly zones."""
    no_fly: list[list[tuple[Finite, Finite]]] = Field(default_factory=list)
    """Polygons (east, north) inside the fence where the drone may not be, at any height."""

    @model_validator(mode="after")
    def _closed(self) -> Self:
        corners = 3
        outlines = [self.polygon, *self.no_fly] if self.polygon else self.no_fly
        if any(len(outline) < corners for outline in outlines):
            message = "a geofence polygon needs at least three corners"
            raise ValueError(message)
        if self.ceiling <= self.floor:
            message = "a geofence's ceiling must lie above its floor"
            raise ValueError(message)
        return self


class LimitsConfig(_Strict):
    """What the drone's actor clamps to, and how long it waits before it protects the drone."""

    cruise_speed: Positive = 1.0
    max_speed: Positive = 5.0
    max_climb: Positive = 1.5
    max_yaw_rate: Positive = 90.0
    """Degrees per second."""
    max_acceleration: Positive = 3.0
    max_range: Positive = 1000.0
    """Metres from the place of take-off that the drone may go."""
    reaction_time: Positive = 0.3
    """Seconds from a setpoint to the vehicle's answer, kept free before every boundary."""
    separation: NotNegative = 2.0
    """Metres kept from the other drones of the environment; 0 for none."""
    takeoff_height: Positive = 1.5
    takeoff_timeout: Positive = 30.0
    """A take-off that takes longer ends in a landing."""
    preflight_timeout: Positive = 5.0
    """Time given to the vehicle's own objections to go away before take-off is refused."""
    arrival_radius: Positive = 0.3
    command_timeout: Positive = 1.0
    """Silence of the navigation after which the drone holds."""
    silence_return: Positive = 20.0
    """Further silence after which it returns home."""
    link_timeout: Positive = 3.0
    """Loss of the vehicle's word or of its position after which the flight is cut short."""
    return_timeout: Positive = 300.0
    """A return that takes longer ends in a landing there; a vehicle unheard for so long is lost."""
    endurance: Positive = 900.0
    """Seconds that a full battery hovers; the energy model's scale."""
    battery_return: Annotated[float, Field(ge=0, le=1)] = 0.25
    """Charge at which the drone returns, earlier where the way home needs more."""
    battery_land: Annotated[float, Field(ge=0, le=1)] = 0.12
    """Charge at which it lands where it is, and that a return keeps in reserve."""
    geofence: GeofenceConfig = GeofenceConfig()

    @model_validator(mode="after")
    def _agree(self) -> Self:
        fence = self.geofence
        contradictions = {
            f"battery_return ({self.battery_return:g}) must be at least battery_land "
            f"({self.battery_land:g}): raise the one or lower the other": (
                self.battery_return < self.battery_land
            ),
            f"cruise_speed ({self.cruise_speed:g} m/s) must not exceed max_speed "
            f"({self.max_speed:g} m/s): lower the one or raise the other": self.cruise_speed
            > self.max_speed,
            f"takeoff_height ({self.takeoff_height:g} m) must lie between the geofence's floor "
            f"({fence.floor:g} m) and ceiling ({fence.ceiling:g} m)": not (
                fence.floor <= self.takeoff_height <= fence.ceiling
            ),
        }
        found = [text for text, wrong in contradictions.items() if wrong]
        if found:
            raise ValueError("; ".join(found))
        return self


class MissionConfig(_Strict):
    """How a mission behaves where the application does not say."""

    on_complete: Literal["return", "land", "hold"] = "return"
    """What follows the last waypoint when no live stream feeds navigation."""
    resume_after: NotNegative = 2.0
    """Silence of urgent velocity commands after which the interrupted plan resumes."""
    plan_timeout: Positive = 5.0
    """Wait for a scheduler's first plan before flying the order given."""
    stall_timeout: Positive = 60.0
    """A waypoint that comes no nearer for so long is given up."""


class SensorConfig(_Strict):
    """One sensor. `driver` names a camera or reading; further settings go to that driver."""

    id: Identifier
    type: Literal["camera", "odometry", "gps", "battery", "status"] = "camera"
    driver: str | None = None
    """None: a camera of its robot's own kind (see `EnvironmentConfig.camera_driver`)."""
    rate: Positive = Field(default=15.0, le=1000.0)
    """Items per second."""
    settings: Settings = Field(default_factory=dict)
    _robot: str | None = PrivateAttr(default=None)

    @property
    def robot(self) -> str | None:
        """The robot that carries it; None for one of the environment's own."""
        return self._robot

    @property
    def full_id(self) -> str:
        """`robot/sensor`, which no other sensor of the file is called; also its stream."""
        return self.id if self._robot is None else f"{self._robot}/{self.id}"

    def carried_by(self, robot: str) -> SensorConfig:
        """The same sensor on board of `robot`."""
        sensor = self.model_copy()
        sensor._robot = robot  # noqa: SLF001 - of this class
        return sensor


class CameraConfig(_Strict):
    """The settings of a camera, from `SensorConfig.settings`."""

    width: Annotated[int, Field(ge=16, le=8192)] = 640
    height: Annotated[int, Field(ge=16, le=8192)] = 360
    horizontal_fov: Annotated[float, Field(gt=1, lt=179)] = 82.6
    """Degrees; the Tello's by default."""
    mount: tuple[Finite, Finite, Finite] = (0.1, 0.0, 0.08)
    """Metres forward, left and up of the body's centre."""
    pitch: Annotated[float, Field(ge=-90, le=90)] = 0.0
    """Degrees downwards."""
    yaw: Annotated[float, Field(ge=-180, le=180)] = 0.0
    """Degrees to the left."""
    depth_range: Annotated[float, Field(ge=3, le=60)] | None = None
    """Metres up to which a simulated camera measures depth as well; None: it measures none."""
    path: SecretUrl | None = None
    """Folder of pictures, video file or URL, for the drivers that read one. User, password and
    parameters of a URL are shown, logged and recorded nowhere."""
    topic: str | None = None
    """Channel of the recording at `path`; None where it holds one camera's pictures only."""
    loop: bool = False


class RobotConfig(_Strict):
    """One drone: its driver, its sensors and its limits."""

    id: Identifier
    driver: str = "simulated"
    settings: Settings = Field(default_factory=dict)
    """Settings of the driver, such as `url` for MAVLink."""
    sensors: list[SensorConfig] = Field(default_factory=list)
    limits: LimitsConfig = LimitsConfig()
    preflight: PreflightConfig = PreflightConfig()
    mission: MissionConfig = MissionConfig()
    edge: Identifier | None = None
    """Compute resource, of the kind `edge`, that flies it; None: the edge beside all drones."""
    start: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    """Where it stands before take-off, ENU metres."""
    start_yaw: Finite = 0.0
    """Degrees counter-clockwise from east."""

    @model_validator(mode="after")
    def _carry(self) -> Self:
        self.sensors[:] = [sensor.carried_by(self.id) for sensor in self.sensors]
        return self


_HTTP = re.compile(r"^https?://[^\s@]+$")


def _plain_http(url: SecretUrl) -> SecretUrl:
    if not _HTTP.match(url.get_secret_value()):
        message = "must be http://… or https://…, without spaces and without user and password"
        raise ValueError(message)
    return url


class EndpointConfig(_Strict):
    """How an inference endpoint is called; the calls come from the edge node."""

    url: Annotated[
        SecretUrl, AfterValidator(_plain_http), Field(json_schema_extra={"pattern": _HTTP.pattern})
    ]
    """Without a password: a secret belongs into `token_env`."""
    protocol: Literal["v2", "function"] = "v2"
    """`v2`: the Open Inference Protocol; `function`: JPEG in, JSON detections out."""
    models: dict[Identifier, str] = Field(default_factory=dict)
    """Name there by analysis. An analytics scheduler may send the analyses named here."""
    timeout: Positive = 2.0
    """Seconds for one frame, all attempts together."""
    retries: Annotated[int, Field(ge=0, le=10)] = 2
    """Further attempts after a refused connection or a busy server, while there is time."""
    cost: NotNegative | None = None
    """Utility that a call costs; None: the analysis' `cloud_cost`."""
    token_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$")] | None = None
    """Environment variable of the edge node that holds the secret to send along."""
    token_header: Annotated[str, Field(pattern=r"^[A-Za-z0-9\-]+$")] = "Authorization"  # noqa: S105
    """As `Bearer …` where it is `Authorization`, else the bare secret."""


class RuntimeEnvConfig(_Strict):
    """What one analysis has for itself: packages, environment variables, or a container."""

    packages: list[str] = Field(default_factory=list)
    """Requirements such as `torch==2.4.1`, or paths of wheels, laid over the node's own."""
    env_vars: dict[str, SecretStr] = Field(default_factory=dict)
    """Environment variables of its process. Their values are shown, logged and recorded nowhere."""
    image_uri: str | None = None
    """Container image, for nodes that have podman; it brings its own packages."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.image_uri is not None and self.packages:
            message = "an image_uri brings its own packages; build them into the image"
            raise ValueError(message)
        for package in self.packages:
            _check_requirement(package)
        for name in self.env_vars:
            if not name.isidentifier() or name.startswith("RAY_"):
                message = f"{name!r} cannot be set: a letter first, and not one of Ray's (RAY_…)"
                raise ValueError(message)
        return self


def _check_requirement(package: str) -> None:
    from packaging.requirements import InvalidRequirement, Requirement  # noqa: PLC0415 - rarely used

    if package.endswith(".whl"):
        return
    try:
        Requirement(package)
    except InvalidRequirement as error:
        reason = shown_text(str(error).splitlines()[0])
        package = shown_text(package)
        message = f"{package!r} is neither a requirement such as name==1.0 nor a wheel: {reason}"
        raise ValueError(message) from None


class ComputeConfig(_Strict):
    """One compute resource: a class of Ray nodes by their custom resource, or an endpoint."""

    id: Identifier
    kind: Literal["edge", "cloud", "http"] = "edge"
    node: str | None = None
    """A named node's address, where the kind alone does not say."""
    executors: Annotated[int, Field(ge=1, le=256)] = 1
    """Inferences that may run at once."""
    compression: Literal["jpeg", "png", "none"] = "jpeg"
    """Of frames that an analytics scheduler sends to a cloud node; `png` is lossless."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 90
    endpoint: EndpointConfig | None = None
    """Of the kind `http`."""
    settings: Settings = Field(default_factory=dict)

    @model_validator(mode="after")
    def _endpoint_of_http(self) -> Self:
        if (self.kind == "http") != (self.endpoint is not None):
            message = 'the kind "http" needs an endpoint, and no other kind has one'
            raise ValueError(message)
        if self.kind == "http" and self.node is not None:
            message = 'the kind "http" has no node; its address is endpoint.url'
            raise ValueError(message)
        return self


class TaskConfig(_Strict):
    """What a scheduler is told of one analysis, by its name; times in milliseconds.

    Benefit and costs are in one unit of the user's choice.
    """

    benefit: Positive = 1.0
    deadline: Positive = 1000.0
    """From the frame's arrival at the dispatcher."""
    edge_time: Positive | None = None
    """Expected execution on the edge; None: measured, 100 until then."""
    cloud_time: Positive | None = None
    """Expected time from sending a frame to the cloud until its result is back.

    None: measured, 300 until then.
    """
    edge_cost: NotNegative = 0.0
    cloud_cost: NotNegative = 0.0
    qoe_bonus: NotNegative = 0.0
    """Worth of a window in which enough results come in time; 0 for none."""
    qoe_share: Annotated[float, Field(gt=0, le=1)] = 0.9
    """Results in time over frames, for the bonus."""
    qoe_window: Positive = 20.0
    """Length of the windows, seconds."""


class TenantConfig(_Strict):
    """One tenant that shares edge and cloud with others, for the scheduler `sfq_dems`."""

    analyses: list[ScopedName] = Field(default_factory=list)
    """Its analyses, by name or `robot/analysis`; those of no tenant share the weight of one."""
    weight: Positive = 1.0
    """Its share is its weight over the sum of all tenants' that have tasks."""


class SchedulersConfig(_Strict):
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


class RecordingConfig(_Strict):
    """What is written to the MCAP file."""

    enabled: bool = True
    path: str | None = None
    """None: a new folder under `runs/`."""
    images: Literal["jpeg", "h264", "png", "none"] = "jpeg"
    """H.264 takes a fraction of JPEG's space and more of a processor. PNG loses nothing, so that a
    replay sees what was seen; it takes several times the space."""
    jpeg_quality: Annotated[int, Field(ge=1, le=100)] = 85
    h264_quality: Annotated[int, Field(ge=1, le=51)] = 23
    """x264's constant rate factor: 18 looks like the original, 28 takes half of 23's space."""
    application_source: bool = False
    """Record the application's source as well; by default its file's name and SHA-256 only."""


class RemoteConfig(_Strict):
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


class SimulationConfig(_Strict):
    """The world of the simulated drones."""

    world: str = "field"
    """A world's registered name, or the path of a scenario file."""
    seed: Annotated[int, Field(ge=0)] = 0
    wind: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    """Mean wind, ENU m/s."""
    gust: NotNegative = 0.0
    """Standard deviation of the gusts, m/s."""
    sensor_noise: NotNegative = 1.0
    """Scales the noise of the simulated odometry and GPS; 0 for none."""


class EnvironmentConfig(_Strict):
    """A whole environment file."""

    model_config = ConfigDict(extra="forbid", frozen=True, title="AeroDaaS environment")

    schema_url: str | None = Field(default=None, alias="$schema")
    name: str = "environment"
    home: HomeConfig | None = None
    terrain: TerrainConfig | None = None
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
            "compute resource": [] if self.compute == "auto" else [c.id for c in self.compute],
        }
        for kind, ids in groups.items():
            twice = sorted({name for name in ids if ids.count(name) > 1})
            if twice:
                message = f"more than one {kind} is called {', '.join(twice)}"
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
    """Check the content of an environment file; raises ConfigError that names `place`."""
    check_plain(content, place)
    return checked(EnvironmentConfig, content, place, " (see `aerodaas schema`)")


def as_runtime_env(content: object, place: str) -> RuntimeEnvConfig:
    """Check what an application says of a runtime_env; raises ConfigError that names `place`."""
    return checked(RuntimeEnvConfig, content, f"{place}: runtime_env")

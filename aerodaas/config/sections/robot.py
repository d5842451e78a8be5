"""One drone of the environment file: its sensors, its limits and its missions."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, PrivateAttr, model_validator
from typing_extensions import Self

from aerodaas.config.checked import Extensible, Finite, NotNegative, Positive, Settings, Strict
from aerodaas.config.extensions import SettingsSection
from aerodaas.config.secrets import SecretUrl
from aerodaas.config.sections.actuators import ActuatorConfig
from aerodaas.config.sections.preflight import PreflightConfig
from aerodaas.identifiers import Identifier

__all__ = [
    "SIMULATED_INTERVAL",
    "CameraConfig",
    "GeofenceConfig",
    "GimbalConfig",
    "LimitsConfig",
    "MissionConfig",
    "RobotConfig",
    "SensorConfig",
]

SIMULATED_INTERVAL = 0.5
"""Seconds from one picture to the next of a simulated camera whose settings say nothing of it."""


class GeofenceConfig(Strict):
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


class LimitsConfig(Extensible):
    """Limits that the drone's node enforces, and the delays of its watchdogs."""

    section: ClassVar[SettingsSection] = "limits"

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
    rangefinder_clearance: NotNegative = 0.0
    """Metres kept above whatever a rangefinder measures below the drone; 0: it is not heeded."""
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
            f"takeoff_height ({self.takeoff_height:g} m) must be at least rangefinder_clearance "
            f"({self.rangefinder_clearance:g} m): raise the one or lower the other": (
                self.takeoff_height < self.rangefinder_clearance
            ),
            f"takeoff_height ({self.takeoff_height:g} m) must lie between the geofence's floor "
            f"({fence.floor:g} m) and ceiling ({fence.ceiling:g} m)": not (
                fence.floor <= self.takeoff_height <= fence.ceiling
            ),
        }
        found = [text for text, wrong in contradictions.items() if wrong]
        if found:
            raise ValueError("; ".join(found))
        return self


class MissionConfig(Extensible):
    """How a mission behaves where the application does not say."""

    section: ClassVar[SettingsSection] = "mission"

    on_complete: Literal["return", "land", "hold"] = "return"
    """What follows the last waypoint when no live stream feeds navigation."""
    resume_after: NotNegative = 2.0
    """Silence of urgent velocity commands after which the interrupted plan resumes."""
    plan_timeout: Positive = 5.0
    """Wait for a scheduler's first plan before flying the order given."""
    stall_timeout: Positive = 60.0
    """A waypoint that comes no nearer for so long is given up."""


class SensorConfig(Strict):
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
        """Copy of the sensor that is on board of `robot`."""
        sensor = self.model_copy()
        sensor._robot = robot  # noqa: SLF001 - of this class
        return sensor


class GimbalConfig(Strict):
    """The gimbal of a camera, which keeps it to the horizon."""

    max_rate: Positive = 60.0
    """Degrees per second at which it turns."""
    lowest: Annotated[float, Field(ge=-180, le=0)] = -90.0
    """Degrees of pitch, negative downwards."""
    highest: Annotated[float, Field(ge=0, le=180)] = 30.0
    widest: Annotated[float, Field(ge=0, le=180)] = 180.0
    """Degrees of yaw to either side."""


class CameraConfig(Strict):
    """The settings of a camera, from `SensorConfig.settings`."""

    width: Annotated[int, Field(ge=16, le=8192)] = 640
    height: Annotated[int, Field(ge=16, le=8192)] = 360
    horizontal_fov: Annotated[float, Field(gt=1, lt=179)] = 82.6
    """Degrees across the picture."""
    mount: tuple[Finite, Finite, Finite] = (0.1, 0.0, 0.08)
    """Metres forward, left and up of the body's centre."""
    pitch: Annotated[float, Field(ge=-90, le=90)] = 0.0
    """Degrees downwards."""
    yaw: Annotated[float, Field(ge=-180, le=180)] = 0.0
    """Degrees to the left."""
    depth_range: Annotated[float, Field(ge=3, le=60)] | None = None
    """Metres up to which a simulated camera measures depth as well; None: it measures none."""
    gimbal: GimbalConfig | None = None
    """The gimbal that it hangs from, pitched and turned as above at first; None: it is bolted to
    the body. A simulated camera's is simulated; of another one it says that there is a gimbal, for
    surveys that are planned."""
    zoom: Annotated[float, Field(ge=1, le=200)] = 1.0
    """How many times narrower than `horizontal_fov` a simulated camera sees at most, by its focal
    length; 1: its lens has no zoom."""
    photo_interval: Positive | None = None
    """Seconds that it needs from one picture to the next; None: 0.5 in simulation, and otherwise
    not known."""
    path: SecretUrl | None = None
    """Folder of pictures, video file or URL, for the drivers that read one; `mavlink` for where a
    MAVLink vehicle itself says that its video is. User, password and parameters of a URL are shown,
    logged and recorded nowhere."""
    topic: str | None = None
    """Channel of the recording at `path`; None where it holds one camera's pictures only."""
    loop: bool = False


class RobotConfig(Extensible):
    """One drone: its driver, its sensors and its limits."""

    section: ClassVar[SettingsSection] = "robot"

    id: Identifier
    driver: str = "simulated"
    settings: Settings = Field(default_factory=dict)
    """Settings of the driver, such as `url` for MAVLink."""
    sensors: list[SensorConfig] = Field(default_factory=list)
    actuators: list[ActuatorConfig] = Field(default_factory=list)
    """What it carries to act with."""
    limits: LimitsConfig = Field(default_factory=LimitsConfig)
    preflight: PreflightConfig = Field(default_factory=PreflightConfig)
    mission: MissionConfig = Field(default_factory=MissionConfig)
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

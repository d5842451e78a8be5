"""Settings of a MAVLink vehicle in an environment file."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, SecretStr, model_validator

from aerodaas.config.checked import checked
from aerodaas.config.model import RobotConfig

__all__ = ["MavlinkSettings", "mavlink_settings"]

_STATION = 255
"""System id of an autopilot's ground station, by default."""
_OBSERVERS = (244, 243)
"""System ids of who only looks; the first that is not a flight's own."""

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Identity = Annotated[int, Field(ge=1, le=255)]


class MavlinkSettings(BaseModel):
    """Settings of a robot whose driver is `mavlink`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    url: str = "udpin:127.0.0.1:14540"
    """`udpin:HOST:PORT` (wait for packets there; HOST is this host's own address, 0.0.0.0 for all
    of them), `udpout:HOST:PORT` (send there first), `tcp:HOST:PORT` or `serial:DEVICE:BAUD`."""
    system: Identity | None = None
    """The vehicle's system id; None takes the first multicopter that is heard."""
    own_system: Identity = 245
    """Our own system id; 255 by default in the role of the ground station."""
    own_component: Identity = 191
    """Our own component id; 191 is an onboard computer."""
    role: Literal["companion", "ground_station"] = "companion"
    """What our heartbeats say that we are. As a ground station their end triggers the autopilot's
    ground-station failsafe; beside a real ground station they hide that it is lost."""
    frame: Literal["start", "home"] = "start"
    """How local coordinates are pinned: the place where it is armed is the robot's `start`, or
    the autopilot's global position is laid over the environment's `home` (global waypoints)."""
    ready_timeout: Positive = 60.0
    """Seconds given to the autopilot to know its position, once it is heard."""
    failsafes: Literal["report", "set", "ignore"] = "report"
    """Parameters that leave it unprotected: say so, set them, or do not ask."""
    fallback: Literal["report", "require", "set", "ignore"] = "report"
    """Whether it comes home by itself once this process is gone: say what keeps it from that;
    refuse to take off until it would; have it come home for as long as we are connected, by
    parameters that are put back afterwards; or do not ask."""
    way_home: Literal["return", "retrace"] = "return"
    """How: straight, or back along the way that was flown, which is ArduPilot's alone."""
    fallback_after: Annotated[float, Field(ge=2, le=120)] = 5.0
    """Seconds of our silence after which it must be on its way home."""
    fence: Literal["off", "warn", "hold", "return", "land"] = "off"
    """Upload the robot's geofence, with this action when it is crossed; `off` leaves the vehicle's
    own fence as it is."""
    forward: str | None = None
    """Pass everything on to a ground station or another program and back, such as
    `udpout:127.0.0.1:14550`."""
    corrections: str | None = None
    """Base station whose RTCM 3 messages are passed on to the vehicle, and to those that share its
    link: `tcp:HOST:PORT` or `serial:DEVICE:BAUD`."""
    signing_key: SecretStr | None = None
    """File with the key of MAVLink 2 signing: 32 bytes, or 64 hexadecimal digits. The environment
    variable AERODAAS_MAVLINK_KEY takes its place."""
    observe: bool = False
    """Connect only to look, as `aerodaas check` does, and a service between missions: nothing
    is set at the vehicle, whatever `failsafes`, `fallback` and `fence` say, and it cannot be flown.
    Judged is what a flight by these settings would meet."""
    max_speed: Positive = 10.0
    """m/s that the vehicle itself can do horizontally."""
    max_climb: Positive = 3.0
    """m/s that the vehicle itself can do vertically."""

    @property
    def sender(self) -> int:
        """System id of what we send.

        An observer's is no flight's: autopilots wait for the heartbeats of one id, and those of
        whoever looks must neither hide that the flight is silent nor leave a silence behind.
        """
        if not self.observe:
            return self.own_system
        return next(one for one in _OBSERVERS if one != self.own_system)

    @property
    def heard_as_station(self) -> bool:
        """Whether our heartbeats are a ground station's."""
        return self.role == "ground_station" and not self.observe

    @model_validator(mode="before")
    @classmethod
    def _numbered_by_role(cls, content: Any) -> Any:  # noqa: ANN401 - anything may be in the file
        station = isinstance(content, dict) and content.get("role") == "ground_station"
        return {"own_system": _STATION, **content} if station else content


def mavlink_settings(robot: RobotConfig) -> MavlinkSettings:
    """Check the settings of `robot`; raises ConfigError that names the robot and the setting."""
    return checked(MavlinkSettings, robot.settings, f"robot {robot.id}: settings")

"""Settings of a Tello and of its camera in an environment file."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.config.checked import checked
from aerodaas.config.model import CameraConfig, RobotConfig, SensorConfig
from aerodaas.errors import ConfigError

__all__ = [
    "STATE_PORT",
    "VIDEO_PORT",
    "TelloCameraSettings",
    "TelloSettings",
    "tello_camera_settings",
    "tello_settings",
    "video_port",
]

STATE_PORT = 8890
"""Port to which a Tello sends its state unless changed by the SDK 3.0 command `port`."""

VIDEO_PORT = 11111
"""The same for its video."""

Port = Annotated[int, Field(ge=1, le=65535)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Fraction = Annotated[float, Field(ge=0, le=1)]


class TelloSettings(BaseModel):
    """Settings of a robot whose driver is `tello`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    address: str = "192.168.10.1"
    """Where the Tello is: as an access point always 192.168.10.1, in station mode what the
    router gave it."""
    command_port: Port = 8889
    """The Tello's port for commands."""
    local_address: str = ""
    """This host's own address to talk from; empty for any. With one address per Tello, several
    in station mode can all send to the default ports."""
    local_port: Annotated[int, Field(ge=0, le=65535)] = 0
    """This host's own port for commands, to which the replies come; 0 for any free one."""
    interface: str = ""
    """Network interface to talk through, such as `wlan1`; empty for the one that the host's
    routes choose. It tells apart two Tellos that are both access points at 192.168.10.1."""
    state_port: Port = STATE_PORT
    """This host's port for state packets. Another than 8890 needs SDK 3.0."""
    full_speed: Positive = 1.0
    """m/s that `rc` at 100 % flies horizontally (see docs/tello.md on how to measure it)."""
    full_climb: Positive = 1.0
    """The same vertically."""
    full_turn: Positive = 100.0
    """Degrees per second that `rc` at 100 % turns."""
    battery_minimum: Fraction = 0.2
    """Charge below which we do not take off; the Tello itself refuses at about 0.1."""
    observe: bool = False
    """Connect only to look, as `aerodaas check` does, and a service between missions: it cannot
    be flown, and is not landed when it is let go of in the air."""


class TelloCameraSettings(CameraConfig):
    """Settings of a sensor whose driver is `tello`; the stream itself says how large it is."""

    horizontal_fov: Annotated[float, Field(gt=1, lt=179)] = 55.2
    """Degrees. From fx = 917.6 pixels at a width of 960, the calibration that aerostack2 ships
    for the Tello; the 82.6 degrees of the data sheet are a photo's diagonal."""
    mount: tuple[float, float, float] = (0.035, 0.0, 0.0)
    """Metres forward, left and up of the body's centre (the same source)."""
    video_port: Port = VIDEO_PORT
    """This host's port for video. Another than 11111 needs SDK 3.0."""
    only_whole: bool = True
    """Leave out the frames between a damaged or lost one and the next key frame: they look smeared.
    False only for people who watch; nothing should fly by such pictures."""


def tello_settings(robot: RobotConfig) -> TelloSettings:
    """Check the settings of `robot`; raises ConfigError that names the robot and the setting."""
    return checked(TelloSettings, robot.settings, f"robot {robot.id}: settings")


def tello_camera_settings(sensor: SensorConfig) -> TelloCameraSettings:
    """Check the settings of `sensor`; raises ConfigError that names the sensor and the setting."""
    return checked(TelloCameraSettings, sensor.settings, f"sensor {sensor.full_id}: settings")


def video_port(robot: RobotConfig) -> int | None:
    """The port at which a camera of `robot` waits for video; None if it carries no Tello camera.

    Raises ConfigError if it carries two: a Tello has one stream.
    """
    cameras = [
        sensor
        for sensor in robot.sensors
        if sensor.type == "camera" and sensor.driver in {None, "tello"}
    ]
    if len(cameras) > 1:
        names = ", ".join(sensor.id for sensor in cameras)
        raise ConfigError(f"robot {robot.id}: a Tello has one video stream, not one for {names}")
    return tello_camera_settings(cameras[0]).video_port if cameras else None

"""Settings of robots and cameras whose driver is `ros2`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.config.checked import checked
from aerodaas.config.model import CameraConfig, EnvironmentConfig, RobotConfig, SensorConfig
from aerodaas.errors import ConfigError
from aerodaas.extensions.ros2.topics.names import Domain, TopicName
from aerodaas.extensions.ros2.topics.stamps import StampSource

__all__ = ["Ros2CameraSettings", "Ros2Settings", "ros2_camera_settings", "ros2_settings"]

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class Ros2Settings(BaseModel):
    """Settings of a robot whose driver is `ros2`."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    odometry: TopicName
    """Topic of `nav_msgs/Odometry`: the pose in an ENU frame, the twist in the body's (REP 103)."""
    velocity: TopicName
    """Topic that the drone takes velocities from."""
    velocity_type: Literal["twist", "twist_stamped"] = "twist"
    """`geometry_msgs/Twist` or `geometry_msgs/TwistStamped`."""
    velocity_frame: Literal["body", "level", "world"] = "body"
    """Axes of these velocities: the body's own (FLU, tilted as it is, as Gazebo takes them), the
    same without its tilt, or those of the odometry's pose (ENU)."""
    frame_id: str = Field(default="", max_length=200)
    """Name of that frame in the header of a `TwistStamped`; empty for that of the odometry:
    its `frame_id` for `world`, its `child_frame_id` otherwise."""
    enable: TopicName | None = None
    """Topic of `std_msgs/Bool` that is told to switch the motors on before a take-off and off after
    a landing, as Gazebo's multicopter control has one."""
    battery: TopicName | None = None
    """Topic of `sensor_msgs/BatteryState`; without one the charge is unknown."""
    fix: TopicName | None = None
    """Topic of `sensor_msgs/NavSatFix`, for sensors of the type `gps`."""
    domain: Domain | None = None
    """DDS domain; by default that of the variable ROS_DOMAIN_ID, or 0."""
    stamps: StampSource = "auto"
    """When the odometry was measured: by its `message`, whose sender's clock then has to be kept
    together with ours, at its `arrival`, or as its first message suggests."""
    align_to_start: bool = False
    """Shift and turn the odometry so that the drone stands at the robot's `start` and `start_yaw`
    when it is connected, for odometry that begins anywhere. By default its frame is home's ENU."""
    odometry_timeout: Annotated[float, Field(ge=0.2, le=10.0)] = 1.0
    """Seconds without odometry after which the drone counts as lost; after half of them it is told
    to stand still."""
    max_speed: Positive = 5.0
    """m/s that the vehicle itself can do horizontally."""
    max_climb: Positive = 2.0
    """m/s that the vehicle itself can do vertically."""
    landing_speed: Annotated[float, Field(ge=0.1, le=2.0)] = 0.4
    """m/s of the descent of a landing."""
    battery_minimum: Annotated[float, Field(ge=0, le=1)] = 0.2
    """Charge below which it does not take off, where the charge is known."""
    observe: bool = False
    """Connect only to look: nothing is published."""


class Ros2CameraSettings(CameraConfig):
    """Settings of a sensor whose driver is `ros2`; the pictures themselves say how large they are.

    `topic` is one of `sensor_msgs/Image`, or of `sensor_msgs/CompressedImage` if its name ends in
    `/compressed`, as image_transport names them.
    """

    topic: TopicName  # pyright: ignore - of these cameras it is required
    domain: Domain | None = None
    """DDS domain; by default that of the robot that carries the camera, if its driver is `ros2`."""
    stamps: StampSource = "auto"
    """When pictures were taken, as with a robot's odometry."""


def ros2_settings(robot: RobotConfig) -> Ros2Settings:
    """Check the settings of `robot`; raises ConfigError that names the robot and the setting."""
    return checked(Ros2Settings, robot.settings, f"robot {robot.id}: settings")


def ros2_camera_settings(
    sensor: SensorConfig, environment: EnvironmentConfig
) -> Ros2CameraSettings:
    """Check the settings of `sensor`, and take the domain of the robot that carries it.

    Args:
        sensor: The camera.
        environment: Its robots; that of the camera gives the domain.

    Raises:
        ConfigError: If a setting is invalid; the message names the sensor and the setting.
    """
    place = f"sensor {sensor.full_id}: settings"
    settings = checked(Ros2CameraSettings, sensor.settings, place)
    if settings.path is not None:
        raise ConfigError(f'{place}: a camera of ROS 2 has a "topic", and no "path"')
    if settings.domain is None:
        for robot in environment.robots:
            if robot.id == sensor.robot and robot.driver == "ros2":
                return settings.model_copy(update={"domain": ros2_settings(robot).domain})
    return settings

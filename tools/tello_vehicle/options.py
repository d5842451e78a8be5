"""Options of an emulated Tello and of its Wi-Fi's impairments."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from aerodaas.config.model import EnvironmentConfig
from aerodaas.extensions.tello.settings import tello_camera_settings
from aerodaas.testing.channel import Impairment

__all__ = ["TelloOptions", "VideoOptions"]


@dataclass(frozen=True)
class VideoOptions:
    """The stream that `streamon` starts."""

    source: Literal["world", "clock"] = "world"
    """The simulated camera, or a moving pattern that carries its own time (`read_clock`)."""
    world: str = "field"
    seed: int = 0
    width: int = 960
    height: int = 720
    rate: float = 30.0
    key_interval: int = 30
    """Frames from one key frame to the next; a Tello sends one about every second."""
    bit_rate: int = 4_000_000
    horizontal_fov: float = 55.2
    """Degrees."""
    pitch: float = 0.0
    """Degrees downwards that it looks."""
    copies: tuple[tuple[str, int], ...] = ()
    """Further addresses and ports that get each video packet, to compare clients."""


@dataclass(frozen=True)
class TelloOptions:
    """One emulated Tello."""

    address: str = "127.0.0.1"
    port: int = 0
    """For commands; 0 for any free one."""
    sdk: Literal[20, 30] = 30
    """SDK 2.0 has no command `port`."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it stands, ENU metres."""
    start_yaw: float = 0.0
    """Degrees counter-clockwise from east."""
    switched_on_yaw: float = 0.0
    """Degrees counter-clockwise by which it has been turned since it was switched on."""
    battery: float = 0.9
    capacity: float = 1.1
    """Ampere-hours."""
    temperature: float = 60.0
    """Degrees Celsius."""
    stick_speed: float = 1.0
    """m/s that `rc` at 100 % flies."""
    stick_turn: float = 100.0
    """Degrees per second that `rc` at 100 % turns."""
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gust: float = 0.0
    seed: int = 0
    commands: Impairment = field(default_factory=Impairment)
    """Impairments towards the Tello."""
    replies: Impairment = field(default_factory=Impairment)
    states: Impairment = field(default_factory=Impairment)
    video_link: Impairment = field(default_factory=Impairment)
    video: VideoOptions = field(default_factory=VideoOptions)

    def placed(self, environment: EnvironmentConfig) -> TelloOptions:
        """The same Tello in place of the environment's first robot, in the world simulated there.

        World, seed, wind, where it stands and how its camera is mounted come from `environment`.
        """
        robot, simulation = environment.robots[0], environment.simulation
        cameras = [sensor for sensor in robot.sensors if sensor.type == "camera"]
        pitch = tello_camera_settings(cameras[0]).pitch if cameras else self.video.pitch
        return replace(
            self,
            start=robot.start,
            start_yaw=robot.start_yaw,
            wind=simulation.wind,
            gust=simulation.gust,
            seed=simulation.seed,
            video=replace(self.video, world=simulation.world, seed=simulation.seed, pitch=pitch),
        )

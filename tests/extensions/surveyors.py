"""Vehicles with a gimbal and a camera: one that does as a test says, and the emulated one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from emulated import Stepped
from flights import PERIOD, Flight, KinematicVehicle

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig, MissionConfig, RobotConfig
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.drivers.simulated import SimulatedVehicle
from aerodaas.extensions.payload.equipment import (
    GimbalTarget,
    LensTarget,
    PhotoFailure,
    PhotoOutcome,
)
from aerodaas.extensions.payload.mavlink.component import MavlinkPayload
from aerodaas.messages.payload import GimbalAttitude, Photo
from aerodaas.messages.vehicle import VehicleState, equipment_of
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import AddNavigation, Start
from aerodaas.mission.loop import SetpointLoop
from aerodaas.mission.mission import Mission
from aerodaas.mission.navigation.planner import InlinePlanner
from aerodaas.schedulers.trajectory.ordered import OrderedScheduler

__all__ = [
    "Camera",
    "Clock",
    "Gimbal",
    "Surveyor",
    "find_payload",
    "fly_pictures",
    "lost",
    "patience",
    "payload_of",
    "photo_outcome",
    "simulated",
    "surveying",
    "take_photo",
]


class Clock:
    """The mission clock of a test."""

    now = 0


@dataclass
class Gimbal:
    """Turns at 1 rad/s, or does as a test says."""

    clock: Clock
    pitch: float = 0.0
    yaw: float = 0.0
    fault: str = ""
    stuck: bool = False
    nonsense: bool = False
    stale: bool = False
    aims: list[GimbalTarget] = field(default_factory=list)
    _seen: int = 0

    def aim(self, target: GimbalTarget) -> GimbalTarget:
        """Turn from now on."""
        self.aims.append(target)
        return target

    @property
    def attitude(self) -> GimbalAttitude:
        """Where it looks, or says so."""
        most = (self.clock.now - self._seen) / NANOSECONDS
        self._seen = self.clock.now
        if self.aims and not self.stuck:
            target = self.aims[-1]
            self.pitch += min(max(target.pitch - self.pitch, -most), most)
            self.yaw += min(max(target.yaw - self.yaw, -most), most)
        stamp = 0 if self.stale else self.clock.now
        return GimbalAttitude(stamp, math.nan if self.nonsense else self.pitch, self.yaw)


@dataclass
class Camera:
    """Takes pictures at once, or does as a test says."""

    clock: Clock
    gimbal: Gimbal | None
    refuses: str = ""
    silent: bool = False
    lens_refuses: str = ""
    lens_hangs: bool = False
    lens: list[LensTarget] = field(default_factory=list)
    films: bool = True
    """Acknowledges orders of video."""
    filming: bool | None = None
    film_fault: str = ""
    film_refuses: str = ""
    filmed: list[bool] = field(default_factory=list)
    """Orders of video."""
    lies: bool = False
    """Answers with other numbers."""
    asked: list[str] = field(default_factory=list)
    _ready: list[PhotoOutcome] = field(default_factory=list)

    def take_photo(self, label: str) -> int:
        """Take one."""
        self.asked.append(label)
        number = len(self.asked)
        if self.refuses:
            self._ready.append(PhotoFailure(number, self.refuses))
        elif not self.silent:
            attitude = self.gimbal.attitude if self.gimbal else None
            told = number + 100 if self.lies else number
            self._ready.append(Photo(told, self.clock.now, label, gimbal=attitude))
        return number

    def adjust(self, target: LensTarget) -> None:
        """Set the lens."""
        self.lens.append(target)

    @property
    def adjusted(self) -> bool:
        """Whether it is set."""
        return not self.lens_hangs

    @property
    def lens_fault(self) -> str:
        """Why it is not."""
        return self.lens_refuses

    def film(self, on: bool) -> None:  # noqa: FBT001 - it is all that is said
        """Begin or end a video."""
        self.filmed.append(on)
        self.film_fault = self.film_refuses
        if not self.film_refuses:
            self.filming = on if self.films else None

    def outcomes(self) -> list[PhotoOutcome]:
        """What came of it."""
        ready, self._ready = self._ready, []
        return ready


class Surveyor(KinematicVehicle):
    """A vehicle with both, unless a test takes them away."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = Clock()
        self.gimbal: Gimbal | None = Gimbal(self.clock)
        self.photo_camera: Camera | None = Camera(self.clock, self.gimbal)

    @property
    def equipment(self) -> tuple[Surveyor]:
        """Both."""
        return (self,)

    def read(self) -> VehicleState:
        """Let its components know the time."""
        state = super().read()
        self.clock.now = state.stamp
        return state


def lost(made: Flight) -> list[str]:
    """What people were told of pictures."""
    return [alert.text for alert in made.mission.alerts if alert.kind == "photo"]


def patience(timeout: float) -> MissionConfig:
    """Options by which gimbal and camera get `timeout` seconds at a waypoint."""
    return MissionConfig.model_validate({"photo_timeout": timeout})


def payload_of(vehicle: object) -> MavlinkPayload:
    """Gimbals and cameras of a MAVLink vehicle."""
    payload = equipment_of(vehicle, MavlinkPayload)
    assert payload is not None
    return payload


def find_payload(ends: Stepped) -> None:
    """Wait for the gimbal's first word, and the camera."""
    payload = payload_of(ends.vehicle)
    ends.wait(lambda: payload.gimbal and payload.photo_camera and payload.gimbal.attitude)


def take_photo(ends: Stepped, label: str = "wp1") -> int:
    """Ask for a picture; its number."""
    camera = payload_of(ends.vehicle).photo_camera
    assert camera is not None
    return camera.take_photo(label)


def photo_outcome(ends: Stepped, timeout: float = 15.0) -> PhotoOutcome:
    """The outcome of the next picture."""
    outcomes: list[PhotoOutcome] = []

    def look() -> bool:
        camera = payload_of(ends.vehicle).photo_camera
        assert camera is not None
        outcomes.extend(camera.outcomes())
        return bool(outcomes)

    ends.wait(look, timeout)
    (outcome,) = outcomes
    return outcome


def fly_pictures(ends: Stepped, each: Callable[[Mission], None] = lambda _: None) -> Mission:
    """A whole mission of two pictures; `each` is called at each turn."""
    stops = [
        Waypoint("a", 3, 0, 2, gimbal_pitch=-math.pi / 2, photo=True),
        Waypoint("b", 3, 3, 2, gimbal_pitch=-0.5, gimbal_yaw=0.7, photo=True),
    ]
    return ends.mission(stops, patience(4.0)).fly(each)


def surveying(
    driver: str = "simulated", *cameras: Mapping[str, object], **limits: object
) -> RobotConfig:
    """A robot with cameras of these settings; by default one that hangs from a gimbal."""
    sensors = [
        {"id": f"cam{n}", "type": "camera", "rate": 2, "settings": settings}
        for n, settings in enumerate(cameras or ({"gimbal": {}},))
    ]
    fast = {"max_speed": 8, "cruise_speed": 5, **limits}
    content = {"id": "drone", "driver": driver, "sensors": sensors, "limits": fast}
    return RobotConfig.model_validate(content)


def simulated(*waypoints: Waypoint, noise: float, wind: float) -> Mission:
    """A flight of the simulated drone, in its own time."""
    robot = surveying()
    world = {"sensor_noise": noise, "wind": (wind, wind, 0.0), "gust": wind / 3}
    environment = EnvironmentConfig.model_validate({"robots": [robot], "simulation": world})
    vehicle = SimulatedVehicle(robot, environment)
    vehicle.connect()
    planner = InlinePlanner(OrderedScheduler())
    place = vehicle.read().odometry.position
    mission = Mission(robot, planner, takeoff=place, vehicle=vehicle)
    loop = SetpointLoop(vehicle, mission)
    mission.handle(AddNavigation(AeroNavigation(data=waypoints)), 0)
    mission.handle(Start(), 0)
    now = 0
    while not mission.finished and now < 300 * NANOSECONDS:
        loop.step(now)
        now += PERIOD
        vehicle.advance_to(now)
    return mission

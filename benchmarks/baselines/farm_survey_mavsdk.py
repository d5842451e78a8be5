"""Farm Survey on a PX4, by MAVSDK: python farm_survey_mavsdk.py udpin://0.0.0.0:14540."""

from __future__ import annotations

import math
import sys
import time
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.telemetry import Telemetry

HEIGHT, SPEED, HOVER, NEAR = 1.5, 0.5, 5.0, 0.3
CORNERS = {"wp1": (0, 0), "wp2": (0, 10), "wp3": (10, 10), "wp4": (10, 0)}
DEGREE = 111_320.0


class Drone:
    """A vehicle whose places are metres east, north and up of where it took off."""

    def __init__(self, url: str) -> None:
        self.sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
        self.sdk.add_any_connection(url)
        system = self.sdk.first_autopilot(30.0)
        self.action, self.telemetry = Action(system), Telemetry(system)
        while not self.telemetry.health_all_ok():
            time.sleep(0.5)
        self.home: Any = self.telemetry.position()

    @property
    def position(self) -> tuple[float, float, float]:
        """Where it is."""
        here, home = self.telemetry.position(), self.home
        east = DEGREE * math.cos(math.radians(home.latitude_deg))
        return (
            (here.longitude_deg - home.longitude_deg) * east,
            (here.latitude_deg - home.latitude_deg) * DEGREE,
            here.relative_altitude_m,
        )

    def take_off(self) -> None:
        """Arm, rise, and fly on at the survey's speed."""
        self.action.set_takeoff_altitude(HEIGHT)
        self.action.arm()
        self.action.takeoff()
        while self.position[2] < HEIGHT - 2 * NEAR:
            time.sleep(0.1)
        self.action.set_current_speed(SPEED)

    def fly_to(self, x: float, y: float) -> None:
        """Fly to a place, and report on the way."""
        home = self.home
        east = DEGREE * math.cos(math.radians(home.latitude_deg))
        self.action.goto_location(
            home.latitude_deg + y / DEGREE,
            home.longitude_deg + x / east,
            home.absolute_altitude_m + HEIGHT,
            math.nan,
        )
        while math.dist(self.position, (x, y, HEIGHT)) > NEAR:
            print(self.report())
            time.sleep(0.2)

    def report(self) -> str:
        """Battery, height and GPS position."""
        charge, place = self.telemetry.battery().remaining_percent, self.telemetry.position()
        where = f"{place.latitude_deg:.6f}, {place.longitude_deg:.6f}"
        return f"battery {charge:.0f} %, height {place.relative_altitude_m:.1f} m, gps {where}"

    def land(self) -> None:
        """Land here, and wait until the motors stand."""
        self.action.land()
        while self.telemetry.armed():
            time.sleep(0.1)


def main() -> None:
    """Visit the corners, the nearest first, and come back."""
    drone = Drone(sys.argv[1])
    print("taking_off")
    drone.take_off()
    left = dict(CORNERS)
    while left:
        name = min(left, key=lambda one: math.dist(drone.position[:2], left[one]))
        place = left.pop(name)
        print("enroute", name)
        drone.fly_to(*place)
        print("loitering", name)
        time.sleep(HOVER)
    print("returning")
    drone.fly_to(0, 0)
    print("landing")
    drone.land()
    print("landed")


if __name__ == "__main__":
    main()

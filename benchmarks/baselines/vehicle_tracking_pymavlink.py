"""Vehicle Tracking on an ArduCopter, by pymavlink: a survey that follows a car, and then resumes.

python vehicle_tracking_pymavlink.py udpin:0.0.0.0:14550 udp://0.0.0.0:5600
"""

from __future__ import annotations

import math
import sys
import time

from ardupilot_copter import Copter
from box_detector import Box, BoxDetector
from ground_geometry import bearing, distance, focal, place, yaw
from video import Video

HEIGHT, SPEED, HOVER, TAKE_OFF = 4.0, 0.7, 5.0, 2.5
PLACES = {"wp1": (0, 12), "wp2": (12, 0), "wp3": (30, 8)}
WEST, EAST, SOUTH, NORTH = -8, 50, -13, 18
CAMERA_PITCH = math.radians(14)
CAR_HEIGHT, FOLLOW_DISTANCE, FOLLOW_HEIGHT = 1.5, 6.0, 2.5
LEAST, MOST = 0.6, 1.6
SURE, LOOKS, HELD, LOST = 0.5, 5, 0.15, 7.0
VELOCITY_AND_YAW_RATE = 0b010111000111
SPEED_GAIN, YAW_GAIN, FASTEST, TURN, EDGE = 0.8, 1.0, 1.5, 0.6, 0.03


class Tracker:
    """Flies and watches."""

    def __init__(self, copter: Copter, video: Video) -> None:
        self.copter, self.video = copter, video
        self.detector = BoxDetector(HELD)
        self.frame = video.next()
        self.looks = 0
        self.left_area = False

    def look(self) -> tuple[float, float] | None:
        """Take in the next picture; returns direction and distance of the surest car."""
        self.frame = self.video.next(self.frame)
        for box in self.detector.find(self.frame)["car"]:
            found = self.locate(box)
            if found is not None:
                self.looks = self.looks + 1 if box.score >= SURE else 0
                return found
        self.looks = 0
        return None

    def locate(self, box: Box) -> tuple[float, float] | None:
        """Direction and distance of a car in the area; None for what stands on no ground."""
        if box.bottom > (1 - EDGE) * self.frame.shape[0]:
            return None
        direction = bearing(self.frame, box.u)
        away = distance(self.frame, box.bottom, self.copter, CAMERA_PITCH)
        by_size = CAR_HEIGHT * focal(self.frame) / max(1.0, box.bottom - box.top)
        if not LEAST < away / by_size < MOST:
            return None
        x, y = place(self.copter, direction, away)
        self.left_area = not (WEST < x < EAST and SOUTH < y < NORTH)
        return None if self.left_area else (direction, away)

    def follow(self) -> None:
        """Keep the distance until the car has left the area, or is out of sight."""
        seen = time.monotonic()
        while time.monotonic() - seen < LOST and not self.left_area:
            car = self.look()
            climb = FOLLOW_HEIGHT - self.copter.position[2]
            if car is None:
                self.steer(0, climb, 0)
                continue
            seen = time.monotonic()
            direction, away = car
            forward = max(-FASTEST, min(FASTEST, SPEED_GAIN * (away - FOLLOW_DISTANCE)))
            turn = max(-TURN, min(TURN, YAW_GAIN * direction))
            self.steer(forward, climb, turn)
        self.looks = 0

    def steer(self, forward: float, climb: float, turn: float) -> None:
        """Fly at a velocity (m/s, rad/s) for at most three seconds."""
        heading = yaw(self.copter)
        north, east = forward * math.sin(heading), forward * math.cos(heading)
        place = acceleration = (0, 0, 0)
        self.copter.set_target(
            VELOCITY_AND_YAW_RATE, *place, north, east, -climb, *acceleration, 0, -turn
        )

    def fly_to(self, name: str, goal: tuple[float, float, float]) -> None:
        """Fly to a place, and follow a car that comes up on the way."""
        print("enroute", name)
        x, y, _ = self.copter.position
        facing = math.atan2(goal[1] - y, goal[0] - x)
        while not self.copter.is_at(goal):
            self.copter.go_to(goal, facing)
            self.look()
            if self.looks >= LOOKS:
                print("diverted")
                self.follow()
                print("enroute", name)


def main() -> None:
    """Survey, and follow a car that is met."""
    url, camera = sys.argv[1:]
    copter, video = Copter(url), Video(camera)
    tracker = Tracker(copter, video)
    print("taking_off")
    copter.take_off(TAKE_OFF, SPEED)
    for name, (x, y) in PLACES.items():
        tracker.fly_to(name, (x, y, HEIGHT))
        print("loitering", name)
        time.sleep(HOVER)
    print("returning")
    home = (0.0, 0.0, HEIGHT)
    while not copter.is_at(home):
        copter.go_to(home)
        time.sleep(0.1)
    print("landing")
    copter.land()
    print("landed")
    video.close()


if __name__ == "__main__":
    main()

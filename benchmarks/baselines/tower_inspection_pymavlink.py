"""Tower Inspection on an ArduCopter, by pymavlink: a search that ends at a radio tower.

python tower_inspection_pymavlink.py udpin:0.0.0.0:14550 udp://0.0.0.0:5600 pictures
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from pathlib import Path

import cv2
from ardupilot_copter import Copter
from box_detector import BoxDetector
from ground_geometry import bearing, distance, place
from video import Video

HEIGHT, SPEED, HOVER, TAKE_OFF = 3.0, 1.0, 3.0, 2.0
PLACES = {"wp1": (-12, 0), "wp2": (-12, 16), "wp3": (12, 16), "wp4": (12, 0)}
BASE, TOP, STEP, STAND_OFF = 2.0, 35.0, 2.0, 8.0
SURE, LOOKS, FRESH, FARTHEST = 0.5, 3, 2.0, 100.0


class Inspector:
    """Flies and watches."""

    def __init__(self, copter: Copter, video: Video) -> None:
        self.copter, self.video = copter, video
        self.detector = BoxDetector(SURE)
        self.frame = video.next()
        self.seen: list[tuple[float, float, float]] = []

    def look(self) -> bool:
        """Take in the next picture; returns whether a tower has been found."""
        self.frame = self.video.next(self.frame)
        for box in self.detector.find(self.frame)["tower"][:1]:
            away = distance(self.frame, box.bottom, self.copter, 0.0)
            if box.bottom < 0.98 * self.frame.shape[0] and away < FARTHEST:
                where = place(self.copter, bearing(self.frame, box.u), away)
                self.seen.append((time.monotonic(), *where))
        recent = [one for one in self.seen if time.monotonic() - one[0] < FRESH]
        return len(recent) >= LOOKS

    @property
    def tower(self) -> tuple[float, float]:
        """Where it stands, metres east and north, by the newest sightings."""
        newest = self.seen[-15:]
        return statistics.median(x for _, x, _ in newest), statistics.median(
            y for _, _, y in newest
        )

    def search(self) -> bool:
        """Fly from place to place; returns whether a tower has been found."""
        for name, (x, y) in PLACES.items():
            print("enroute", name)
            here = self.copter.position
            yaw = math.atan2(y - here[1], x - here[0])
            while not self.copter.is_at((x, y, HEIGHT)):
                self.copter.go_to((x, y, HEIGHT), yaw)
                if self.look():
                    return True
            print("loitering", name)
            until = time.monotonic() + HOVER
            while time.monotonic() < until:
                if self.look():
                    return True
        return False

    def inspect(self, folder: Path) -> None:
        """Go up and down before the tower, a picture every two metres."""
        folder.mkdir(parents=True, exist_ok=True)
        self.approach()
        x, y, _ = self.copter.position
        yaw = math.atan2(self.tower[1] - y, self.tower[0] - x)
        for step in range(math.ceil((TOP - BASE) / STEP) + 1):
            height = min(BASE + step * STEP, TOP)
            self.wait_at((x, y, height), yaw)
            cv2.imwrite(str(folder / f"{height:04.1f}m.jpg"), self.video.next(self.video.frame))
        self.wait_at((x, y, BASE), yaw)

    def approach(self) -> None:
        """Fly to the stand-off, while the tower's place becomes clearer."""
        while True:
            x, y, _ = self.copter.position
            east, north = self.tower
            yaw, away = math.atan2(north - y, east - x), math.hypot(east - x, north - y)
            goal = (east - STAND_OFF * math.cos(yaw), north - STAND_OFF * math.sin(yaw), BASE)
            if away < STAND_OFF or self.copter.is_at(goal):
                return
            self.copter.go_to(goal, yaw)
            self.look()

    def wait_at(self, goal: tuple[float, float, float], yaw: float) -> None:
        """Fly to a place and wait until it is reached."""
        while not self.copter.is_at(goal):
            self.copter.go_to(goal, yaw)
            time.sleep(0.1)


def main() -> None:
    """Search, inspect, land."""
    url, camera, folder = sys.argv[1:]
    copter, video = Copter(url), Video(camera)
    inspector = Inspector(copter, video)
    print("taking_off")
    copter.take_off(TAKE_OFF, SPEED)
    if inspector.search():
        print("following")
        inspector.inspect(Path(folder))
    print("landing")
    copter.land()
    print("landed")
    video.close()


if __name__ == "__main__":
    main()

"""Search and Rescue on a Tello, by djitellopy: python search_and_rescue_djitellopy.py.

Searches an area; the person in a hazard vest who is found is escorted to safety. It looks north
where it takes off; places are metres east and north of there.
"""

from __future__ import annotations

import math
import time

from box_detector import Box, BoxDetector
from djitellopy import Tello
from vest_following import VestFollower, next_frame, steer

CRUISE, HOVER, RISE = 1.0, 3.0, 70
PLACES = {"wp1": (0, 12), "wp2": (14, 13), "wp3": (24, 26), "wp4": (0, 26)}
SAFE, SAFE_RADIUS = (57, 6), 3.0
SURE, LOOKS, GIVE_UP = 0.5, 5, 30.0
NEAR = 0.3


class Rescuer:
    """Flies by dead reckoning, as a Tello knows its velocity and not its place, and watches."""

    def __init__(self, tello: Tello) -> None:
        self.tello, self.video = tello, tello.get_frame_read()
        self.detector, self.follower = BoxDetector(), VestFollower(tello, 0.0)
        self.frame = self.video.frame
        self.east = self.north = 0.0
        self.updated = time.monotonic()
        self.looks = 0

    def look(self) -> Box | None:
        """Take in the next picture, and carry the place on; returns the vest in it."""
        self.frame = next_frame(self.video, self.frame)
        now = time.monotonic()
        step, self.updated = now - self.updated, now
        self.north += self.tello.get_speed_x() / 10 * step
        self.east += self.tello.get_speed_y() / 10 * step
        vests = self.detector.find(self.frame, rgb=True)["vest"]
        vest = max(vests, key=lambda box: box.score * (box.bottom - box.top), default=None)
        self.looks = self.looks + 1 if vest is not None and vest.score >= SURE else 0
        return vest

    def fly_to(self, place: tuple[float, float]) -> bool:
        """Fly to a place; returns whether a vest was found on the way."""
        while (away := math.dist((self.east, self.north), place)) > NEAR:
            self.look()
            if self.looks >= LOOKS:
                return True
            direction = math.atan2(place[1] - self.north, place[0] - self.east)
            yaw = math.pi / 2 - math.radians(self.tello.get_yaw())
            off = math.remainder(direction - yaw, math.tau)
            speed = min(CRUISE, away)
            steer(self.tello, speed * math.cos(off), speed * math.sin(off), 1.5 * off)
        return False

    def hover(self) -> bool:
        """Stay for a while; returns whether a vest was found."""
        until = time.monotonic() + HOVER
        while time.monotonic() < until:
            self.look()
            steer(self.tello, 0.0, 0.0, 0.0)
            if self.looks >= LOOKS:
                return True
        return False

    def search(self) -> bool:
        """Visit the places; returns whether a vest was found."""
        for name, place in PLACES.items():
            print("enroute", name)
            if self.fly_to(place):
                return True
            print("loitering", name)
            if self.hover():
                return True
        return False

    def escort(self) -> None:
        """Follow until the person is safe, or lost."""
        while math.dist((self.east, self.north), SAFE) > SAFE_RADIUS:
            vest = self.look()
            self.follower.follow(vest, self.frame)
            if self.follower.unseen() > GIVE_UP:
                return


def main() -> None:
    """Search, follow, land."""
    tello = Tello()
    tello.connect()
    tello.streamon()
    rescuer = Rescuer(tello)
    print("taking_off")
    tello.takeoff()
    tello.move_up(RISE)
    rescuer.updated = time.monotonic()
    if rescuer.search():
        print("following")
        rescuer.escort()
    print("landing")
    tello.land()
    print("landed")


if __name__ == "__main__":
    main()

"""Situation Awareness on a Tello, by djitellopy: python situation_awareness_djitellopy.py LOG.

Follows a person in a hazard vest; a raised hand lands the drone, a fall alerts people. LOG is what
the person's phone writes.
"""

from __future__ import annotations

import csv
import math
import sys
from collections import deque
from pathlib import Path

from box_detector import BoxDetector
from djitellopy import Tello
from raised_hand import RaisedHand
from vest_following import VestFollower, next_frame

CAMERA_PITCH = math.radians(12)
RISE = 70
GIVE_UP = 30.0
FALL_LOOKS, HAND_LOOKS, HAND_OF = 4, 8, 12


def phone_position(log: Path) -> list[str]:
    """The newest row of the phone's log."""
    with log.open(encoding="utf-8") as rows:
        return deque(csv.reader(rows), maxlen=1)[0]


def main() -> None:
    """Take off, follow and watch, land."""
    log = Path(sys.argv[1])
    tello = Tello()
    tello.connect()
    tello.streamon()
    video = tello.get_frame_read()
    detector, hand = BoxDetector(), RaisedHand()
    print("taking_off")
    tello.takeoff()
    tello.move_up(RISE)
    follower = VestFollower(tello, CAMERA_PITCH)
    frame, fallen, hands = video.frame, 0, deque([False], HAND_OF)
    print("following")
    while follower.unseen() < GIVE_UP and sum(hands) < HAND_LOOKS:
        frame = next_frame(video, frame)
        found = detector.find(frame, rgb=True)
        vest = max(found["vest"], key=lambda box: box.score * (box.bottom - box.top), default=None)
        follower.follow(vest, frame)
        if vest is None:
            continue
        fallen = fallen + 1 if follower.lying else 0
        if fallen == FALL_LOOKS:
            print("alert the person has a fall, phone at", *phone_position(log))
        wearer = [box for box in found["person"] if box.holds(vest)]
        hands.append(bool(wearer) and hand.shows(frame, wearer[0]))
    print("landing")
    tello.land()
    print("landed")


if __name__ == "__main__":
    main()

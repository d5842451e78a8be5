"""Farm Survey on an ArduCopter, by pymavlink.

python farm_survey_pymavlink.py udpin:0.0.0.0:14550
"""

from __future__ import annotations

import math
import sys
import time

from ardupilot_copter import Copter
from surveying import fly_to

HEIGHT, SPEED, HOVER = 1.5, 0.5, 5.0
CORNERS = {"wp1": (0, 0), "wp2": (0, 10), "wp3": (10, 10), "wp4": (10, 0)}


def main() -> None:
    """Visit the corners, the nearest first, and come back."""
    copter = Copter(sys.argv[1])
    print("taking_off")
    copter.take_off(HEIGHT, SPEED)
    left = dict(CORNERS)
    while left:
        name = min(left, key=lambda one: math.dist(copter.position[:2], left[one]))
        place = (*left.pop(name), HEIGHT)
        print("enroute", name)
        fly_to(copter, place)
        print("loitering", name)
        time.sleep(HOVER)
    print("returning")
    fly_to(copter, (0, 0, HEIGHT))
    print("landing")
    copter.land()
    print("landed")


if __name__ == "__main__":
    main()

"""A program that flies until it is killed, and says when it is on its way.

python -m sitl.victim URL [SETTING=VALUE ...]
"""

from __future__ import annotations

import sys

from aerodaas.navigation.commands import AddNavigation
from aerodaas.status import MissionState
from aerodaas.waypoints import AeroNavigation, NavigationType, Waypoint
from sitl.flights import SitlFlight

if __name__ == "__main__":
    far = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("far", 0, 80, 3.0)])
    settings = dict(word.split("=") for word in sys.argv[2:])
    flight = SitlFlight(sys.argv[1], AddNavigation(far), settings=settings)
    flight.run_to(MissionState.ENROUTE)
    sys.stdout.write("enroute\n")
    sys.stdout.flush()
    flight.run(600.0)

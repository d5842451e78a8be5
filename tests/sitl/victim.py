"""A program that flies until it is killed, and says when it is on its way.

python -m sitl.victim URL [SETTING=VALUE ...]
"""

from __future__ import annotations

import json
import sys
from typing import Any

from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.messages.mission import MissionState
from aerodaas.messages.waypoints import NavigationType, Waypoint
from aerodaas.mission.commands import AddNavigation
from sitl.flights import SitlFlight


def setting(word: str) -> tuple[str, Any]:
    """A setting of the driver; its value is JSON, or a bare word."""
    name, _, value = word.partition("=")
    try:
        return name, json.loads(value)
    except ValueError:
        return name, value


if __name__ == "__main__":
    far = AeroNavigation(NavigationType.DISTANCE_DRIVEN, [Waypoint("far", 0, 80, 3.0)])
    settings = dict(map(setting, sys.argv[2:]))
    flight = SitlFlight(sys.argv[1], AddNavigation(far), settings=settings)
    flight.run_to(MissionState.ENROUTE)
    sys.stdout.write("enroute\n")
    sys.stdout.flush()
    flight.run(600.0)

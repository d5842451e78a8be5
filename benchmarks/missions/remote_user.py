"""The remote user of the Disaster Survey, a process of its own: `python remote_user.py URL`.

Waits until two waypoints have been visited, then adds three more in one request, and prints the
mission's answer.
"""

from __future__ import annotations

import json
import sys
import time

from aerodaas.environment.remote_client import RemoteClient
from aerodaas.errors import AeroDaaSError

_PATIENCE = 300.0
"""Wall seconds to wait for the mission to come so far."""
_ENOUGH = 2


def main(url: str, places: list[list[float]]) -> None:
    """Play the part; raises MissionError where the mission refuses."""
    client = RemoteClient(url)
    given_up = time.monotonic() + _PATIENCE
    while time.monotonic() < given_up:
        try:
            if len(client.status().mission.visited) >= _ENOUGH:
                break
        except AeroDaaSError:
            time.sleep(0.2)  # not there yet
        time.sleep(0.05)
    waypoints = [
        {"id": f"remote{number}", "x": x, "y": y, "z": z, "hover_duration": 3.0}
        for number, (x, y, z) in enumerate(places, start=1)
    ]
    print(json.dumps(client.add_waypoints(waypoints, ordered=False)))


if __name__ == "__main__":
    main(sys.argv[1], json.loads(sys.argv[2]))

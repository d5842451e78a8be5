"""A real PX4 and a real ArduCopter in simulation behind the service, flown by URL.

`AERODAAS_SITL_PX4` and `AERODAAS_SITL_ARDUPILOT` name them (docs/mavlink.md says how); what is not
named is skipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from required import needs_peer, peer
from served import Served, document, fleet
from sitl.autopilot import autopilot as started
from sitl.conftest import VARIABLES
from sitl.flights import robot_at
from sitl.relay import Relay

from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

pytestmark = [pytest.mark.sitl, pytest.mark.slow, pytest.mark.timeout(420), pytest.mark.wall_clock]

FENCE = {"polygon": [[-20, -20], [60, -20], [60, 60], [-20, 60]], "ceiling": 20}
BOOT_SECONDS = 5.0


@pytest.fixture(
    params=[pytest.param(family, marks=needs_peer(name)) for family, name in VARIABLES.items()]
)
def relay(request: pytest.FixtureRequest) -> Iterator[Relay]:
    """The way to each autopilot that is named, with a witness of where it truly is."""
    with started(request.param, peer(VARIABLES[request.param]), BOOT_SECONDS) as autopilot:
        way = Relay(autopilot.url)
        yield way
        way.close()


@pytest.fixture
def served(relay: Relay) -> Iterator[Served]:
    """A provider of this one vehicle."""
    drone = robot_at(relay.url, geofence=FENCE).model_dump(mode="json", exclude_unset=True)
    drone["sensors"] = [{"id": "odometry", "type": "odometry", "rate": 10}]
    with Served(fleet(drone)) as service:
        yield service


def test_it_flies_by_url_as_rehearsed(served: Served, relay: Relay) -> None:
    """Rehearsed on a simulated drone, then flown to each place by the vehicle, and back to home."""
    token = served.user("asha", "growers")
    body = {"document": document("drone", (0, 12), (12, 12)), "minutes": 5}
    id_ = served.ask("POST", "/v1/missions", body, token)["id"]
    ended = served.until_phase(id_)
    assert (ended["phase"], ended["reason"]) == ("landed", "")
    assert ended["verdict"]["approved"]
    assert relay.witness.away < 1.5
    assert not relay.witness.armed
    status, content = served.send("GET", f"/v1/missions/{id_}/recording", token=token)
    assert status == 200
    path = served.folder / "fetched.mcap"
    path.write_bytes(content)
    with Recording.open(path) as recording:
        flight = RecordedFlight.read(recording).robots["drone"]
    places = np.array(flight.states)[:, 1:3].astype(float)
    for place in ((0, 12), (12, 12)):
        assert np.linalg.norm(places - place, axis=1).min() < 1.0
    (robot,) = served.ask("GET", "/v1/fleet", token=token)["robots"]
    assert 0.2 < robot["battery"] <= 1.0


def test_who_provides_it_stays_in_command(served: Served, relay: Relay) -> None:
    """A waypoint added in flight is flown to, one beyond the fence refused; leases are revoked."""
    token = served.user("asha", "growers")
    lease = served.ask("POST", "/v1/leases", {"robots": ["drone"], "minutes": 5}, token)["id"]
    body = {"document": document("drone", (0, 40)), "lease": lease}
    id_ = served.ask("POST", "/v1/missions", body, token)["id"]
    served.until(lambda: north(served.mission(id_)) > 6.0)
    way = f"/v1/missions/{id_}/navigation"
    both = [place("near", 10, 10), place("far", 50, 50)]
    instead = {"robot": "drone", "clear_first": True, "ordered": True, "waypoints": both}
    assert served.ask("POST", way, instead, token)["accepted"]
    beyond = {"robot": "drone", "waypoints": [place("beyond", 200, 0)]}
    assert "beyond" in str(served.ask("POST", way, beyond, token))
    served.until(lambda: "near" in served.mission(id_)["status"]["drone"]["mission"]["visited"])
    served.ask("DELETE", f"/v1/leases/{lease}")
    ended = served.until_phase(id_)
    assert ended["phase"] == "landed"
    assert "lease has ended" in ended["reason"]
    assert "far" not in ended["status"]["drone"]["mission"]["visited"]
    assert relay.witness.away < 1.5
    assert not relay.witness.armed


def north(mission: dict[str, Any]) -> float:
    """Metres north of home, as far as the service knows."""
    vehicle = mission["status"].get("drone", {}).get("vehicle")
    return float(vehicle["odometry"]["position"]["y"] or 0.0) if vehicle else 0.0


def place(name: str, east: float, north: float) -> dict[str, object]:
    """A waypoint 3 m up."""
    return {"id": name, "x": east, "y": north, "z": 3.0, "waypoint_type": "local"}

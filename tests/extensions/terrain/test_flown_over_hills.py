"""Flights over hilly ground in the simulator, judged by the recording's truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded, robot
from numpy.typing import NDArray

from aerodaas import AeroNavigation, Environment, Waypoint
from aerodaas.config.model import validated
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.documents.checking import check_document
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.protocol.proposals import CheckReport
from aerodaas.recording.reader import Recording, vehicle_states
from aerodaas.terrain.ground import Ground
from aerodaas.terrain.terrain import Terrain

Array = NDArray[np.float64]

_HOME = {"latitude": 47.1, "longitude": 8.1, "altitude": 590.0, "above_sea": 541.0}
_CLEARANCE = 10.0
_LIMITS = {
    "cruise_speed": 6.0,
    "max_speed": 8.0,
    "max_climb": 3.0,
    "max_acceleration": 4.0,
    "takeoff_height": 12.0,
    "max_range": 600.0,
    "geofence": {"floor": -30.0, "ceiling": 120.0},
}


def _hilly(flyer: Flyer) -> dict[str, Any]:
    """An environment over hills of 40 m, in a tile that this writes; home lies between them."""
    side = 1201
    latitudes = 48.0 - np.arange(side)[:, None] / (side - 1)
    longitudes = 8.0 + np.arange(side)[None, :] / (side - 1)
    heights = 540.0 + 20.0 * (
        1.0 - np.cos(900.0 * (longitudes - 8.1)) * np.cos(700.0 * (latitudes - 47.1))
    )
    path = flyer.folder / "N47E008.hgt"
    path.write_bytes(np.rint(heights).astype(">i2").tobytes())
    return {
        **FLAT,
        "home": _HOME,
        "terrain": {"files": ["N47E008.hgt"], "clearance": _CLEARANCE},
        "robots": [{**robot(), "limits": _LIMITS}],
    }


@pytest.mark.wall_clock
def test_a_flight_over_hills_keeps_its_clearance(flyer: Flyer) -> None:
    """Legs above ground follow it, one above home is lifted over a hill, and so is the return."""

    def build(environment: Environment) -> None:
        asked = [
            Waypoint("edge", 60, 0, 25, above="ground"),
            Waypoint("across", 400, 120, 25, above="ground"),
            Waypoint("low", 60, 20, 16, waypoint_type="local"),
            Waypoint("sea", 0, 200, 600, above="sea"),
        ]
        environment.get_robot_by_id("drone").navigate(AeroNavigation(data=asked))

    run = flyer.fly(build, _hilly(flyer), simulated_time=True)
    drone = recorded(run).robots["drone"]
    assert drone.visited == ("edge", "across", "low", "sea")
    assert drone.plan["sea"][2] == pytest.approx(600.0 - 541.0)
    assert run.recording is not None
    with Recording.open(run.recording) as recording:
        states = [state for _, state in vehicle_states(recording, "drone")]
    files = [flyer.folder / "N47E008.hgt"]
    ground = Ground(Terrain.open(files), GeodeticOrigin(47.1, 8.1, 590.0), np.zeros(3), 600.0)
    truth = [one.truth.position for one in states if one.truth and one.mode is VehicleMode.GUIDED]
    above = np.array([p[2] - ground.height(p[0], p[1]) for p in truth])
    # Noise of position and height, and the lag of the climb.
    assert above.min() > _CLEARANCE - 1.0
    assert drone.clipped["ground"]
    reached = next(index for index, p in enumerate(truth) if p[0] > 395.0)
    leg = [index for index, p in enumerate(truth) if index < reached and p[0] > 80.0]
    assert above[leg].min() > 25.0 - 1.5
    assert above[leg].max() < 25.0 + 3.0


def test_a_waypoint_too_near_to_the_ground_is_found_without_flying(flyer: Flyer) -> None:
    """The remedy is a height that passes."""
    hilly = _hilly(flyer)
    hilly["terrain"]["files"] = [str(flyer.folder / "N47E008.hgt")]
    environment = validated(hilly, "the hills")

    def check(up: float) -> CheckReport:
        stop = {"id": "low", "x": 400, "y": 120, "z": up, "waypoint_type": "local"}
        navigation = [{"robot": "drone", "waypoints": [stop]}]
        content = {"format": "aerodaas-mission", "version": 1, "navigation": navigation}
        return check_document(MissionDocument.model_validate(content), environment)

    (found,) = check(12.0).findings
    assert (found.check, found.waypoint, found.measured) == ("ground", "low", 12.0)
    assert found.limit is not None
    assert check(found.limit + 0.1).passed

"""Golden flights are compared to the last digit, and each has a summary that is kept."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tools.golden.flights import FLIGHTS
from tools.golden.summary import differences

KEPT = Path(__file__).parents[1] / "golden"
FLIGHT = {
    "states": {"drone": [[0.0, "taking_off", ""], [3.2, "enroute", "flying to b"]]},
    "counts": {"/drone/state": 455},
    "ends": {"drone": [22.7, 0.1, -0.04]},
    "digest": "c4ca4238",
}


def test_each_flight_is_kept() -> None:
    """One that is not would be equal to nothing."""
    assert {path.stem for path in KEPT.glob("*.json")} == set(FLIGHTS)


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("counts", "/drone/state"), 454),
        (("ends", "drone"), [22.7, 0.1, -0.04000000000000001]),
        (("ends", "drone"), [22.7, 0.1]),
        (("states", "drone"), []),
        (("counts", "/drone/cam"), 1),
    ],
)
def test_the_least_change_is_told_with_its_place(path: tuple[str, str], value: object) -> None:
    """A digit, a message, an entry more or less."""
    flown = json.loads(json.dumps(FLIGHT))
    assert list(differences(FLIGHT, flown)) == []
    flown[path[0]][path[1]] = value
    told = list(differences(FLIGHT, flown))
    assert told
    assert all(line.startswith("/".join(("", *path))) for line in told)


@pytest.mark.parametrize("near", [0.5, 1.5])
def test_flights_of_other_processors_and_of_the_wall_clock_need_only_be_near(near: float) -> None:
    """Metres and seconds may differ by a little, states and waypoints not at all."""
    flown = json.loads(json.dumps(FLIGHT))
    flown["ends"]["drone"] = [22.7 + 0.8 * near, 0.1 - 0.8 * near, 0.3]
    flown["digest"] = "eccbc87e"
    assert list(differences(FLIGHT, flown, near=near)) == []
    flown["ends"]["drone"][1] = 0.1 + 1.2 * near
    assert len(list(differences(FLIGHT, flown, near=near))) == 1
    flown["states"]["drone"][1][1] = "returning"
    assert len(list(differences(FLIGHT, flown, near=near))) == 2

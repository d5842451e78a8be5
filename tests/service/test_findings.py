"""Each reason to refuse a flight: with its figures, its place and a remedy, and not too early."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import pytest

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.protocol.proposals import ClearanceOut
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.recording.report.flight import Band, RecordedFlight, RobotFlight
from aerodaas.service.flights.orders import OtherLease
from aerodaas.service.rehearsal.clearance import clearances
from aerodaas.service.rehearsal.findings import Finding, findings_of, together

FENCE = {"polygon": [[-20, -20], [20, -20], [20, 20], [-20, 20]], "ceiling": 30}


def field(**limits: Any) -> EnvironmentConfig:  # noqa: ANN401
    """One drone in a square of 40 m."""
    return validated(
        {"robots": [{"id": "drone", "limits": {"geofence": FENCE, **limits}}]}, "the field"
    )


def flown(path: Sequence[tuple[float, float]], **fields: Any) -> RecordedFlight:  # noqa: ANN401
    """A flight over these places, one each ten seconds, two metres up, that then landed."""
    states = [
        (10.0 * number, east, north, 2.0, 1.0 - number / 100)
        for number, (east, north) in enumerate(path)
    ]
    end = states[-1][0]
    bands = [Band("enroute", 0.0, end), Band("landed", end, end)]
    robot = RobotFlight(states=states, bands=bands, **fields)
    robot.states.append((end + 1.0, *states[-1][1:]))
    flight = RecordedFlight()
    flight.robots["drone"] = robot
    return flight


def reasons(
    flight: RecordedFlight,
    *,
    minutes: float = 1.0,
    others: Sequence[OtherLease] = (),
    **limits: Any,  # noqa: ANN401
) -> list[Finding]:
    """Findings about a flight in the field."""
    return findings_of(flight, field(**limits), minutes=minutes, others=others)


ROUND = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 0.0)]


def test_a_good_flight_has_none() -> None:
    """Landed in time, inside its fence, alone."""
    assert reasons(flown(ROUND)) == []


def test_a_flight_ends_within_the_lease() -> None:
    """At 30 s sharp it is within half a minute; a second before that it is not."""
    assert reasons(flown(ROUND), minutes=0.5) == []
    (found,) = reasons(flown(ROUND), minutes=29 / 60)
    assert found.text.startswith("drone landed after 30 s, and the lease is for 29 s: ask for")


def test_a_flight_that_does_not_land_is_refused() -> None:
    """Where it was last seen, with its state."""
    flight = flown(ROUND)
    flight.robots["drone"].bands = [Band("following", 0.0, 31.0, "after a vest")]
    (found,) = reasons(flight)
    assert "had not landed after 31 s (following: after a vest), and the lease is" in found.text
    assert found.place == (0.0, 0.0)
    flight.robots["drone"].bands[0] = Band("aborted", 31.0, 31.0, "take-off refused: no position")
    (found,) = reasons(flight)
    assert "did not land as planned: aborted: take-off refused: no position" in found.text


@pytest.mark.parametrize(("east", "outside"), [(19.9, None), (20.0, None), (20.6, "0.6")])
def test_the_fence_is_not_left(east: float, outside: str | None) -> None:
    """Its edge belongs to it."""
    found = reasons(flown([*ROUND, (east, 5.0), (0.0, 0.0)]), minutes=2)
    assert bool(found) == (outside is not None)
    if outside:
        assert found[0].text.startswith(f"drone left the fence by {outside} m at (20.6, 5.0): plan")
        assert found[0].place == (20.6, 5.0)


@pytest.mark.parametrize(
    ("limit", "what"),
    [("geofence", "the fence"), ("ceiling", "the greatest height"), ("max_range", "range")],
)
def test_setpoints_changed_by_a_boundary_are_a_reason(limit: str, what: str) -> None:
    """With their number and the first one's time and place; a clamped speed is none."""
    flight = flown(
        ROUND,
        clipped=Counter({limit: 7, "max_speed": 90}),
        clipped_at={limit: 20.0, "max_speed": 1.0},
    )
    (found,) = reasons(flight)
    assert what in found.text
    assert "changed 7 setpoints, first after 20.0 s at (10.0, 10.0)" in found.text
    assert found.place == (10.0, 10.0)


def test_a_waypoint_given_up_is_a_reason() -> None:
    """With its place."""
    flight = flown(ROUND, given_up=("far",), plan={"far": (15.0, 3.0, 2.0)})
    (found,) = reasons(flight)
    assert "gave up waypoint far at (15.0, 3.0)" in found.text
    assert found.place == (15.0, 3.0)


def test_the_battery_keeps_its_reserve() -> None:
    """97 % are left: enough for a reserve of 97 %, too little for one of 98 %."""
    assert reasons(flown(ROUND), battery_return=0.99, battery_land=0.97) == []
    (found,) = reasons(flown(ROUND), battery_return=0.99, battery_land=0.98)
    assert "began with 100% of its battery and ended with 97%, below the reserve of" in found.text


def box(west: float, south: float) -> OtherLease:
    """Another's lease of 4 m by 4 m."""
    corners = [(west, south), (west + 4, south), (west + 4, south + 4), (west, south + 4)]
    return OtherLease(id="b7", area=corners)


def test_other_leases_are_kept_away_from() -> None:
    """By the separation of the drone's limits; inside, whatever that is."""
    assert reasons(flown(ROUND), others=[box(12.0, 8.0)], separation=2.0) == []
    (found,) = reasons(flown(ROUND), others=[box(12.0, 8.0), box(30, 30)], separation=2.1)
    assert "flew to 2.00 m from the area of lease b7 at (10.0, 10.0), and 2.1 m are" in found.text
    assert found.place == (10.0, 10.0)
    (found,) = reasons(flown(ROUND), others=[box(8.0, 8.0)], separation=0.0)
    assert "flew into the area of lease b7 at (10.0, 10.0)" in found.text


def test_a_drone_on_the_ground_is_nobodys_danger() -> None:
    """It may stand within another's area after its landing."""
    flight = flown(ROUND)
    flight.robots["drone"].states.append((40.0, 25.0, 25.0, 0.0, 0.9))
    assert reasons(flight, others=[box(24.0, 24.0)]) == []


@pytest.mark.parametrize(
    ("distance", "told"), [(0.0, "hit building barn at"), (0.49, "came to 0.49 m"), (0.5, "")]
)
def test_things_are_kept_away_from(distance: float, told: str) -> None:
    """With the place, the height and the distance that is to be kept."""
    near = ClearanceOut(
        distance=distance,
        thing="barn",
        label="building",
        robot="drone",
        place=(10.0, 4.0, 2.0),
        time=14.0,
    )
    found = findings_of(flown(ROUND), field(), minutes=1, nearest=[near])
    assert bool(found) == bool(told)
    for one in found:
        assert told in one.text
        assert "(10.0, 4.0), 2.0 m up, after 14.0 s, and 0.5 m are to be kept: fly" in one.text
        assert one.place == (10.0, 4.0)


def test_a_drone_that_has_landed_beside_something_is_not_near_it() -> None:
    """The distance counts in the air."""
    flight = flown([(0.0, 5.0), (10.0, 5.0)])
    truth = [(5.0, 9.0, 5.0, 3.0), (20.0, 13.7, 5.0, 0.0)]
    flight.robots["drone"].truth = truth
    world = {"simulation": {"world": "field"}}
    (found,) = clearances(flight, validated({"robots": [{"id": "drone"}], **world}, "the field"))
    assert (found.thing, found.time, found.place) == ("fence", 5.0, (9.0, 5.0, 3.0))


def verdict(seed: int, *reasons: str, **fields: Any) -> VerdictOut:  # noqa: ANN401
    """Of a flight with this seed."""
    return VerdictOut(approved=not reasons, reasons=list(reasons), seeds=[seed], **fields)


def near(distance: float) -> ClearanceOut:
    """Of a drone to a barn."""
    names = {"thing": "barn", "label": "building", "robot": "drone"}
    return ClearanceOut(distance=distance, place=(0.0, 0.0, 2.0), time=1.0, **names)


def test_flights_are_judged_together() -> None:
    """Each has to be good; a reason of some names their seeds, and the worst figures count."""
    good = [verdict(1, seconds=40.0, clearance=near(1.2)), verdict(2, clearance=near(0.7))]
    both = together(good)
    assert (both.approved, both.reasons, both.seeds) == (True, [], [1, 2])
    assert both.clearance == near(0.7)
    assert both.seconds == 40.0
    assert together([verdict(1), verdict(2)]).clearance is None
    bad = together([verdict(1, "late"), verdict(2, "late", "low"), verdict(3, "late", "low")])
    assert not bad.approved
    assert bad.reasons == ["late", "seed 2, 3: low"]
    one = verdict(4, "late")
    assert together([one]) == one
    assert not together([verdict(1), verdict(2, "late")]).approved


def test_alerts_of_failures_are_reasons_and_results_are_not() -> None:
    """A fall that an analysis saw is what the mission is for; each text counts once."""
    flight = flown(ROUND)
    flight.alerts = [(3.0, "fallen", "a person has fallen")]
    assert reasons(flight) == []
    flight.alerts += [(5.0, "analysis_failed", "pose: no such model")] * 2
    (found,) = reasons(flight)
    assert found.text == "after 5.0 s, analysis failed: pose: no such model"


def test_a_mission_without_a_flight_is_refused() -> None:
    """Nothing was navigated."""
    (found,) = reasons(RecordedFlight())
    assert "no drone has flown" in found.text

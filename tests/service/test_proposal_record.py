"""What an approval is bound to, and where it ends: hash, lapse, envelope, difference."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from served import document

from aerodaas.clock import WallOffset
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.protocol.proposals import Envelope
from aerodaas.service.proposals.record import (
    Conditions,
    ProposalRecord,
    envelope_violation,
    lapse_reason,
    proposal_hash,
)
from aerodaas.service.proposals.summary import difference, records_of

DOCUMENT = MissionDocument.model_validate(document("one", (5, 0), (9, 3)))
CONDITIONS = Conditions(
    at=100.0,
    offset=WallOffset("boot", 50.0),
    battery={"one": 0.8},
    wind=2.0,
    limits={"one": {"max_speed": 5.0}},
)
RECORD = ProposalRecord(conditions=CONDITIONS)
VERDICT = {"approved": True, "seconds": 60.0}
LENGTHS = st.floats(0.0, 10.0)
PLACES = st.lists(st.tuples(LENGTHS, LENGTHS, st.floats(2.0, 8.0)), min_size=2, max_size=6)
ENVELOPE = Envelope(
    area=[(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)], floor=2.0, ceiling=8.0, minutes=4.0
)


def moved(number: int, **changes: float) -> MissionDocument:
    """The document with one waypoint changed."""
    entry = DOCUMENT.navigation[0]
    waypoints = list(entry.waypoints)
    waypoints[number] = replace(waypoints[number], **changes)
    return DOCUMENT.model_copy(
        update={"navigation": [entry.model_copy(update={"waypoints": waypoints})]}
    )


def test_another_document_limit_lease_verdict_or_charge_has_another_hash() -> None:
    """And the same ones the same."""
    cases: list[tuple[MissionDocument, ProposalRecord, float, dict[str, Any] | None]] = [
        (DOCUMENT, RECORD, 15.0, VERDICT),
        (moved(1, z=2.5), RECORD, 15.0, VERDICT),
        (DOCUMENT, RECORD, 15.1, VERDICT),
        (DOCUMENT, RECORD, 15.0, None),
        (DOCUMENT, RECORD, 15.0, {**VERDICT, "seconds": 61.0}),
        (DOCUMENT, RECORD.model_copy(update={"change_of": "other"}), 15.0, VERDICT),
    ]
    for changes in ({"limits": {}}, {"battery": {"one": 0.79}}, {"at": 101.0}, {"wind": 3.0}):
        conditions = CONDITIONS.model_copy(update=changes)
        record = RECORD.model_copy(update={"conditions": conditions})
        cases.append((DOCUMENT, record, 15.0, VERDICT))
    hashes = [proposal_hash(*case) for case in cases]
    assert len(set(hashes)) == len(cases)
    assert hashes == [proposal_hash(*case) for case in cases]


@given(st.floats(0.0, 1.0), st.floats(0.0, 10.0))
def test_less_charge_and_more_wind_only_ever_lapse(charge: float, wind: float) -> None:
    """What is good stays good with more charge and less wind."""
    present = CONDITIONS.model_copy(update={"battery": {"one": charge}, "wind": wind})
    lapsed = bool(lapse_reason(CONDITIONS, present))
    assert lapsed is (0.8 - charge > 0.03 + 1e-9 or wind > 3.0)


@given(PLACES, st.floats(0.0, 4.0))
def test_a_way_within_all_bounds_lies_in_the_envelope(
    places: list[tuple[float, float, float]], minutes: float
) -> None:
    """The area is convex."""
    assert envelope_violation(ENVELOPE, places, minutes) == ""


@given(PLACES, st.integers(0, 5), st.sampled_from([(0, 10.5), (1, -0.5), (2, 8.5), (2, 1.5)]))
def test_one_place_beyond_one_bound_does_not(
    places: list[tuple[float, float, float]], number: int, beyond: tuple[int, float]
) -> None:
    """Whichever place and bound."""
    axis, value = beyond
    place = list(places[number % len(places)])
    place[axis] = value
    places[number % len(places)] = (place[0], place[1], place[2])
    assert envelope_violation(ENVELOPE, places, 1.0)


@given(st.floats(4.001, 1e6) | st.just(float("nan")))
def test_nor_does_a_landing_after_the_approved_minutes(minutes: float) -> None:
    """Or one at an unknown moment."""
    assert envelope_violation(ENVELOPE, [(1.0, 1.0, 3.0), (2.0, 2.0, 3.0)], minutes)


@given(st.integers(0, 1), st.sampled_from("xyz"), st.floats(0.1, 5.0))
def test_a_difference_names_the_waypoint_that_moves(number: int, axis: str, step: float) -> None:
    """By its number, and nothing else."""
    assert difference(DOCUMENT, DOCUMENT) == []
    before = getattr(DOCUMENT.navigation[0].waypoints[number], axis)
    (told,) = difference(DOCUMENT, moved(number, **{axis: before + step}))
    assert f"waypoint {number + 1} " in told


def test_cameras_and_analyses_of_their_pictures_are_told() -> None:
    """Also those that read another one's results; what reads no pictures is not."""
    analyses = [
        {"id": "one/pose", "analysis": "PoseAnalytics", "reads": ["one/cam"]},
        {"id": "one/fall", "analysis": "BodyPoseEmergencyAnalytics", "reads": ["one/pose"]},
        {"id": "one/log", "analysis": "GpsLoggerAnalytics", "reads": ["one/odometry"]},
    ]
    content = document("one", (5, 0), analyses=analyses, sensors=["one/cam", "one/odometry"])
    told = "\n".join(records_of(MissionDocument.model_validate(content), ["one/cam", "two/cam"]))
    assert all(word in told for word in ("one/cam", "PoseAnalytics", "BodyPoseEmergency"))
    assert "two/cam" not in told
    assert "GpsLogger" not in told

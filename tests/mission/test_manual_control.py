"""Flying by hand: through the same guard as anything else, and by a dead man's switch."""

from __future__ import annotations

import numpy as np
import pytest
from flights import Flight, add, flight

from aerodaas.config.model import GeofenceConfig, LimitsConfig
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import PositionSetpoint, VelocitySetpoint
from aerodaas.messages.waypoints import VelocityCommand, Waypoint
from aerodaas.mission.command_handler import MANUAL_SECONDS
from aerodaas.mission.commands import (
    End,
    Pause,
    ReleaseControls,
    Resume,
    ReturnHome,
    Steer,
    TakeControls,
)

ASHA = TakeControls("asha", 7)
BINA = TakeControls("bina", 8)
LIMITS = LimitsConfig(
    max_speed=3.0,
    geofence=GeofenceConfig(polygon=[(-10, -10), (30, -10), (30, 10), (-10, 10)]),
)
FAR = Waypoint("far", 25, 0, 1.5)


def steer(
    session: int = 7, valid_for: float = 0.5, forward: float = 0.0, yaw_rate: float = 0.0
) -> Steer:
    """A velocity by hand."""
    return Steer(session, VelocityCommand(forward, yaw_rate=yaw_rate, valid_for=valid_for))


def taken(limits: LimitsConfig = LIMITS) -> Flight:
    """A flight whose controls asha has taken on the way to a waypoint, 5 m from home."""
    found = flight(add(FAR), limits=limits)
    found.run(until=lambda: bool(found.vehicle.position[0] > 5.0))
    assert found.tell(ASHA).accepted
    return found


def test_a_drone_is_flown_by_hand_and_its_mission_goes_on_afterwards() -> None:
    """It stops for the takeover, obeys in its own frame, holds when let go, and resumes."""
    found = taken()
    found.keep_saying(steer, 1.0, rate=10)
    found.vehicle.yaw = np.pi / 2
    found.keep_saying(lambda: steer(forward=1.0), 3.0, rate=10)
    found.expect(S.PAUSED)
    assert (found.status.reason, found.status.pilot) == ("flown by hand by asha", "asha")
    assert found.vehicle.position[1] > 2.0
    assert found.tell(ReleaseControls(7)).accepted
    found.run(3.0)
    found.expect(S.PAUSED)
    assert (found.status.reason, found.status.pilot) == ("asha let go", "")
    stood = found.vehicle.position.copy()
    found.run(2.0)
    assert np.linalg.norm(found.vehicle.position - stood) < 0.1
    assert stood[1] > 2.0, "it holds there, and not where it was taken over"
    assert found.tell(Resume()).accepted
    found.run()
    found.expect(S.LANDED)
    assert found.status.visited == ("far",)


def test_silence_brakes_within_its_bound() -> None:
    """Whoever falls silent at full speed, and however long their command says it is valid."""
    found = taken()
    found.keep_saying(lambda: steer(forward=2.0, valid_for=60.0), 2.0, rate=10)
    last = found.now
    found.tell(steer(forward=2.0, valid_for=60.0))
    found.run(until=lambda: isinstance(found.records[-1].asked, PositionSetpoint))
    assert (found.now - last) / 1e9 <= MANUAL_SECONDS + 0.1 <= 0.5
    found.run(3.0)
    assert np.linalg.norm(found.vehicle.velocity) < 0.1
    assert (found.status.reason, found.status.pilot) == ("nothing is heard of asha", "")
    found.expect(S.PAUSED)


def test_letting_go_of_the_keys_brakes_at_once() -> None:
    """A velocity of zero is a place to stay at, not a drift."""
    found = taken()
    found.keep_saying(lambda: steer(forward=2.0), 2.0, rate=10)
    found.tell(steer())
    assert isinstance(found.turn().asked, PositionSetpoint)
    assert found.status.pilot == "asha"


def test_a_turn_on_the_spot_is_a_movement() -> None:
    """Yaw alone is obeyed."""
    found = taken()
    found.run(1.0)
    before = found.vehicle.yaw
    found.keep_saying(lambda: steer(yaw_rate=0.5), 1.0, rate=10)
    assert found.vehicle.yaw - before > 0.3


def test_the_guard_is_the_same_as_ever() -> None:
    """Speed limit and fence clamp what is asked for by hand."""
    found = taken()
    found.vehicle.yaw = 0.0
    found.keep_saying(lambda: steer(forward=50.0), 12.0, rate=10)
    track = np.array(found.track)
    assert np.linalg.norm(np.diff(track, axis=0), axis=1).max() / 0.05 < 3.1
    assert 28.0 < track[:, 0].max() <= 30.0
    clipped = {name for record in found.records for name in record.clipped_by}
    assert {"max_speed", "geofence"} <= clipped


def test_one_operator_at_a_time() -> None:
    """Another is told who has the controls; may have them once the first lets go or is silent."""
    found = taken()
    found.tell(steer())
    assert found.tell(BINA).text == "asha has the controls"
    assert found.tell(steer(session=8, forward=1.0)).text == "asha has the controls"
    assert not found.tell(ReleaseControls(8)).accepted
    assert found.status.pilot == "asha"
    found.run(0.5)
    assert found.tell(BINA).accepted
    assert found.tell(steer(forward=2.0)).text == "bina has the controls"
    assert found.status.pilot == "bina"


def test_a_hiccup_ends_nothing_and_a_release_does() -> None:
    """Whoever was silent for a moment flies on; whoever has let go takes the controls anew."""
    found = taken()
    found.run(1.0)
    assert found.status.pilot == ""
    assert found.tell(steer(forward=1.0)).accepted
    assert found.status.pilot == "asha"
    found.tell(ReleaseControls(7))
    assert found.tell(steer(forward=1.0)).text == "take the controls first"
    assert isinstance(found.turn().asked, PositionSetpoint)


def test_nobody_resumes_under_the_hands_of_another() -> None:
    """And after a resume, words of the former takeover come too late."""
    found = taken()
    found.tell(steer())
    assert found.tell(Resume()).text == "asha has the controls: let go of them first"
    found.run(0.5)
    assert found.tell(Resume()).accepted
    found.run_to(S.ENROUTE)
    assert found.tell(steer(forward=1.0)).text == "take the controls first"
    found.turn()
    found.expect(S.ENROUTE)


@pytest.mark.parametrize(("command", "state"), [(ReturnHome(), S.RETURNING), (End(), S.LANDING)])
def test_a_drone_that_leaves_is_not_held_back(command: ReturnHome | End, state: S) -> None:
    """Return and land count for whoever asks; a hand on the controls does not stop them."""
    found = taken()
    found.tell(steer(forward=1.0))
    assert found.tell(command).accepted
    assert found.tell(steer(forward=1.0)).text == f"the drone is {state.value} by now"
    assert found.tell(ASHA).text == f"the drone is {state.value} by now"
    found.run()
    found.expect(S.LANDED)


def test_in_the_air_only() -> None:
    """Not before take-off and not during it; a pause is no hindrance."""
    found = flight(add(FAR))
    assert "in the air only" in found.tell(ASHA).text
    found.run_to(S.TAKING_OFF)
    assert "in the air only" in found.tell(ASHA).text
    found.run_to(S.ENROUTE)
    found.tell(Pause())
    found.turn()
    assert found.tell(ASHA).accepted


def test_a_lost_link_counts_for_more_than_a_hand() -> None:
    """A fault that has the drone hold has it hold."""
    found = taken()
    found.keep_saying(lambda: steer(forward=1.0), 1.0, rate=10)
    found.vehicle.lost = True
    found.tell(steer(forward=1.0))
    assert not isinstance(found.turn().asked, VelocitySetpoint)

"""Remote ID over MAVLink: who operates is told, and a transmitter that is not ready is minded."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from autopilot import HERE
from bench import Bench
from emulated import FAMILIES, Stepped

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.extensions.remote_id.settings import RemoteIdConfig
from aerodaas.extensions.remote_id.transmitter import RemoteId
from aerodaas.messages.health import HealthItem, Verdict
from aerodaas.messages.mission import MissionState as S
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.messages.waypoints import Waypoint
from aerodaas.mission.commands import ReturnHome
from aerodaas.mission.safety.checklist import Checklist
from tools.mavlink_vehicle import AutopilotOptions

NUMBER = "FIN87astrdge12k8"
WHO = {
    "operator_id": f"{NUMBER}-xyz",
    "uas_id": "1581F5FKD229400DR3K0",
    "description": "farm survey",
    "category": "open",
    "uas_class": 1,
}
REQUIRED = {"remote_id": "require"}
GOOD, BAD = 0, 1
READY = mavlink.MAVLink_open_drone_id_arm_status_message(GOOD, b"")


def ends_of(
    monkeypatch: pytest.MonkeyPatch,
    family: str = "px4",
    *,
    carried: bool = True,
    **settings: Any,  # noqa: ANN401
) -> Stepped:
    """Both ends, with a transmitter if it is `carried`."""
    options = AutopilotOptions(family=family, remote_id=carried)  # type: ignore[arg-type]
    return Stepped(monkeypatch, options, **{"remote_id": WHO, "preflight": REQUIRED, **settings})


def listed(ends: Stepped) -> list[HealthItem]:
    """The list before take-off."""
    robot = ends.robot
    return Checklist(ends.vehicle, robot.limits, robot.preflight).examine(ends.vehicle.read())


def item(ends: Stepped) -> HealthItem | None:
    """Remote ID in it."""
    return next((one for one in listed(ends) if one.name == "remote_id"), None)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_transmitter_is_told_who_operates_what_from_where(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of it within four seconds, the place each second; the secret end never."""
    with ends_of(monkeypatch, family) as ends:
        ends.watch(20.0)
        told = ends.autopilot.transmitter.newest
        assert set(told) == {
            f"OPEN_DRONE_ID_{kind}"
            for kind in ("BASIC_ID", "OPERATOR_ID", "SELF_ID", "SYSTEM", "SYSTEM_UPDATE")
        }
        operator = told["OPEN_DRONE_ID_OPERATOR_ID"]
        assert operator.operator_id == NUMBER
        assert operator.operator_id_type == mavlink.MAV_ODID_OPERATOR_ID_TYPE_CAA
        basic = told["OPEN_DRONE_ID_BASIC_ID"]
        assert bytes(basic.uas_id).rstrip(b"\0").decode() == WHO["uas_id"]
        assert basic.id_type == mavlink.MAV_ODID_ID_TYPE_SERIAL_NUMBER
        assert basic.ua_type == mavlink.MAV_ODID_UA_TYPE_HELICOPTER_OR_MULTIROTOR
        assert told["OPEN_DRONE_ID_SELF_ID"].description == "farm survey"
        system = told["OPEN_DRONE_ID_SYSTEM"]
        assert system.operator_location_type == mavlink.MAV_ODID_OPERATOR_LOCATION_TYPE_TAKEOFF
        assert system.operator_latitude == pytest.approx(473977420, abs=20)
        assert system.operator_longitude == pytest.approx(85455940, abs=20)
        # The GPS' height above the ellipsoid, 47 m above that above the sea.
        assert system.operator_altitude_geo == pytest.approx(535.0, abs=1.0)
        assert system.classification_type == mavlink.MAV_ODID_CLASSIFICATION_TYPE_EU
        assert system.category_eu == mavlink.MAV_ODID_CATEGORY_EU_OPEN
        assert system.class_eu == mavlink.MAV_ODID_CLASS_EU_CLASS_1
        update = told["OPEN_DRONE_ID_SYSTEM_UPDATE"]
        for field in ("operator_latitude", "operator_longitude", "operator_altitude_geo"):
            assert getattr(update, field) == getattr(system, field)
        heard = ends.autopilot.transmitter.heard
        assert not any(b"xyz" in bytes(message.get_msgbuf()) for _, message in heard)
        assert {(one.target_system, one.target_component) for _, one in heard} == {(1, 0)}
        # What belongs to the place comes before the place alone.
        assert heard[0][1].get_type() == "OPEN_DRONE_ID_SYSTEM"
        placed = [now for now, one in heard if "SYSTEM" in one.get_type()]
        gaps = [after - before for before, after in pairwise(placed)]
        assert len(placed) == pytest.approx(20, abs=1)
        assert max(gaps) < 1.1


def test_the_place_of_the_take_off_stays_where_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """While the drone flies away from it."""
    with ends_of(monkeypatch) as ends:
        flying = ends.mission([Waypoint("far", 40, 0, 3)])
        flying.until(lambda: flying.visited)
        system = ends.autopilot.transmitter.newest["OPEN_DRONE_ID_SYSTEM"]
        assert ends.autopilot.truth.position[0] > 39.0
        assert system.operator_longitude == pytest.approx(85455940, abs=30)


def test_who_only_looks_does_not_say_which_aircraft_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """A transmitter may keep the first number for good; the rest lets it be judged."""
    with ends_of(monkeypatch, observe=True) as ends:
        ends.watch(8.0)
        told = ends.autopilot.transmitter.newest
        assert "OPEN_DRONE_ID_BASIC_ID" not in told
        assert "OPEN_DRONE_ID_OPERATOR_ID" in told
        found = item(ends)
        assert found is not None
        assert found.value == "missing basic_id message"


def test_nothing_is_said_where_nothing_is_configured(monkeypatch: pytest.MonkeyPatch) -> None:
    """And a transmitter that is heard is judged all the same."""
    with ends_of(monkeypatch, remote_id=None) as ends:
        ends.watch(5.0)
        assert ends.autopilot.transmitter.heard == []
        found = item(ends)
        assert found is not None
        assert (found.value, found.verdict) == ("missing basic_id message", Verdict.REFUSED)


@pytest.mark.parametrize(
    ("level", "configured", "carried", "error", "value", "verdict"),
    [
        ("require", True, True, "", "ready", Verdict.GOOD),
        ("require", True, True, "no GPS fix", "no GPS fix", Verdict.REFUSED),
        ("require", True, False, "", "no transmitter is heard", Verdict.REFUSED),
        ("require", False, False, "", "not known", Verdict.REFUSED),
        ("refuse", True, False, "", "no transmitter is heard", Verdict.REFUSED),
        ("refuse", False, False, "", "not known", Verdict.UNKNOWN),
        ("warn", True, True, "no GPS fix", "no GPS fix", Verdict.WARNING),
        ("warn", True, False, "", "no transmitter is heard", Verdict.WARNING),
        ("ignore", True, True, "no GPS fix", None, None),
    ],
)
def test_the_list_before_take_off_has_the_transmitters_own_words(
    monkeypatch: pytest.MonkeyPatch,
    level: str,
    configured: bool,  # noqa: FBT001
    carried: bool,  # noqa: FBT001
    error: str,
    value: str | None,
    verdict: Verdict | None,
) -> None:
    """By the level of the robot's preflight."""
    with ends_of(
        monkeypatch,
        carried=carried,
        remote_id=WHO if configured else None,
        preflight={"remote_id": level},
    ) as ends:
        ends.autopilot.transmitter.error = error
        ends.watch(6.0)
        found = item(ends)
        # It is in the list once.
        assert not any("Remote ID" in one.value for one in listed(ends))
        if value is None:
            assert found is None
            return
        assert found is not None
        assert (found.value, found.verdict) == (value, verdict)
        assert bool(found.remedy) is (verdict in {Verdict.WARNING, Verdict.REFUSED})


STOP = Waypoint("there", 12, 0, 3)


@pytest.mark.parametrize("family", FAMILIES)
def test_a_take_off_is_refused_with_the_transmitters_own_words(
    family: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the robot requires it; nothing moves."""
    with ends_of(monkeypatch, family) as ends:
        ends.autopilot.transmitter.error = "bad LOC accuracy"
        mission = ends.mission([STOP]).fly()
        assert mission.state is S.ABORTED
        assert "take-off refused: remote_id: bad LOC accuracy" in mission.status.reason
        assert ends.autopilot.firmware.motions == []
        assert not ends.autopilot.armed


@pytest.mark.parametrize("trouble", ["silent", "unhealthy"])
@pytest.mark.parametrize("leaving", [False, True])
def test_a_transmitter_lost_in_flight_is_told_once(
    trouble: str,
    leaving: bool,  # noqa: FBT001
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """On the way out as on the way home; the flight goes on as it would have."""
    with ends_of(monkeypatch) as ends:
        flight = ends.mission([STOP])
        mission = flight.mission
        flight.until(S.ENROUTE)
        if leaving:
            flight.run(3.0)
            mission.handle(ReturnHome("the test says so"), flight.now())
        if trouble == "silent":
            ends.autopilot.transmitter.present = False
        else:
            ends.autopilot.transmitter.error = "TX: power lost"
        flight.fly()
        assert mission.state is S.LANDED
        assert list(mission.status.visited) == ([] if leaving else ["there"])
        (told,) = flight.told()
        if trouble == "silent":
            assert told.startswith("Remote ID: the transmitter has said nothing for ")
        else:
            assert told == "Remote ID: TX: power lost"


def arm_status(status: int, error: bytes = b"", component: int = 236) -> Any:  # noqa: ANN401
    """One word of a transmitter, decoded."""
    codec = mavlink.MAVLink(None, 1, component)
    message = mavlink.MAVLink_open_drone_id_arm_status_message(status, error)
    return codec.decode(bytearray(message.pack(codec)))


def listener() -> RemoteId:
    """One that is configured."""
    return RemoteId(RemoteIdConfig(), observes=False)


def test_three_seconds_are_fresh_and_no_more() -> None:
    """To the dot."""
    told = listener()
    told.on_arm_status(arm_status(GOOD), 10.0)
    assert told.objection(13.0) == ""
    assert told.objection(13.001) == "the transmitter has said nothing for 3 s"
    told.on_arm_status(arm_status(GOOD), 14.0)
    assert told.objection(14.0) == ""


@pytest.mark.parametrize(
    ("status", "error", "said"),
    [
        (GOOD, b"", ""),
        (BAD, b"no GPS", "no GPS"),
        (BAD, b"", "the transmitter is not ready, and does not say why"),
        (7, b"", "the transmitter is not ready, and does not say why"),
        (255, b"x" * 50, "x" * 50),
        (BAD, b"bad \x1b[31m\xff  red\n", "bad [31m red"),
    ],
)
def test_only_zero_is_ready(status: int, error: bytes, said: str) -> None:
    """Whatever else it says; what cannot be printed is not shown."""
    told = listener()
    told.on_arm_status(arm_status(status, error), 0.0)
    objection = told.objection(0.0)
    assert objection is not None
    assert objection.replace("\ufffd", "").replace("  ", " ") == said


def test_of_two_transmitters_both_must_be_ready() -> None:
    """The one that is not is told of."""
    told = listener()
    told.on_arm_status(arm_status(GOOD, component=236), 0.0)
    told.on_arm_status(arm_status(BAD, b"second", component=237), 0.0)
    assert told.objection(1.0) == "second"
    told.on_arm_status(arm_status(GOOD, component=237), 1.0)
    assert told.objection(1.0) == ""


@pytest.mark.parametrize(
    ("system", "component", "peer", "heard"),
    [
        (1, 236, None, True),
        (1, 237, None, True),
        (1, 238, None, True),
        (1, 1, None, True),
        (1, 235, None, False),
        (1, 239, None, False),
        (2, 236, None, False),
        (1, 236, ("203.0.113.9", 14550), False),
    ],
)
def test_only_the_vehicles_own_transmitter_is_heard(
    monkeypatch: pytest.MonkeyPatch,
    system: int,
    component: int,
    peer: tuple[str, int] | None,
    heard: bool,  # noqa: FBT001
) -> None:
    """Its autopilot's, or a transmitter's of its system, from its own address."""
    bench = Bench(monkeypatch, remote_id=WHO)
    bench.connect()
    bench.autopilot.say(READY, peer or HERE, (system, component))
    bench.clock.advance(0.1)
    told = bench.vehicle.health().objections.get("remote_id")
    assert told == ("" if heard else "no transmitter is heard")
    bench.close()


@pytest.mark.parametrize("flies", [True, False])
def test_a_transmitter_does_not_speak_for_the_vehicle(
    flies: bool,  # noqa: FBT001
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its words hide no silent autopilot, in the air and on the ground."""
    bench = Bench(monkeypatch, remote_id=WHO)
    bench.connect()
    if flies:
        bench.fly()
    bench.hush()
    for _ in range(60):
        for ids in ((1, 236), (1, 1)):
            bench.autopilot.say(READY, HERE, ids)
        bench.turn()
    assert bench.turn() is VehicleMode.LOST
    assert "no word from the vehicle for 3 s" in bench.vehicle.preflight()
    assert bench.vehicle.health().objections.get("remote_id") == ""
    assert math.isclose(bench.vehicle.read().extra["silence"], 3.0, abs_tol=0.2)
    bench.close()

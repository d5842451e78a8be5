"""The vehicle comes home once our process is gone, and its owner's settings come back to it."""

from __future__ import annotations

import subprocess
import sys
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from emulated import LOOPBACK, Flight, Stepped, free_port
from typing_extensions import Self
from waiting import until

from aerodaas.drivers.mavlink.microservices import fallback
from aerodaas.drivers.mavlink.vehicle import MavlinkVehicle
from aerodaas.errors import VehicleError
from tools.mavlink_vehicle import AutopilotOptions, EmulatedAutopilot

TESTS = Path(__file__).parents[2]
ARDUPILOT = AutopilotOptions(family="ardupilot", ready_after=0.0)
AS_PX4 = AutopilotOptions(family="px4", ready_after=0.0)
OWN = {"FS_GCS_ENABLE": 0.0, "MAV_GCS_SYSID": 255.0, "FS_OPTIONS": 16.0}
"""What its owner has set, and what is set for a flight."""
OURS = {"FS_GCS_ENABLE": 1.0, "MAV_GCS_SYSID": 245.0, "FS_OPTIONS": 24.0}


def values(pair: Stepped) -> dict[str, float]:
    """What is set on the vehicle, of what matters here."""
    held = pair.autopilot.firmware.parameters.values
    return {name: held[name] for name in OWN}


@pytest.mark.slow
@pytest.mark.wall_clock
def test_a_killed_process_leaves_a_vehicle_that_comes_home(state_folder: Path) -> None:
    """`kill -9` on the way out: it flies back and lands, by the emulator's truth.

    Two vehicles at once: ArduPilot and PX4.
    """
    with ExitStack() as open_:
        flights = [open_.enter_context(Killed(options)) for options in (ARDUPILOT, AS_PX4)]
        for one in flights:
            one.kill_away_from_home()
        for one in flights:
            until(lambda: not one.autopilot.armed, 60.0)  # noqa: B023 - called at once
            assert away(one.autopilot) < 1.5
    assert list(state_folder.rglob("*.json")), "what is to be put back is not known any more"


class Killed:
    """A vehicle, and a process that flies it with a fallback."""

    def __init__(self, options: AutopilotOptions) -> None:
        self.autopilot = EmulatedAutopilot(replace(options, peer=(LOOPBACK, free_port())))
        host, port = self.autopilot.options.peer
        command = [sys.executable, "-m", "sitl.victim", f"udpin:{host}:{port}"]
        command += ["fallback=set", "fallback_after=2"]
        self._process = subprocess.Popen(command, cwd=TESTS)

    def __enter__(self) -> Self:
        self.autopilot.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        self.autopilot.stop()

    def kill_away_from_home(self) -> None:
        """`kill -9`, as soon as it is 4 m away."""
        until(lambda: away(self.autopilot) > 4.0, 60.0)
        self._process.kill()
        self._process.wait()


def away(autopilot: EmulatedAutopilot) -> float:
    """Metres over ground from where it stood."""
    return float(np.linalg.norm(autopilot.truth.position[:2]))


def test_the_owner_gets_everything_back(flight: Flight, state_folder: Path) -> None:
    """While we are connected it would come home; afterwards it is as it was."""
    with flight(ARDUPILOT, fallback="set") as pair:
        assert values(pair) == OURS
        assert pair.vehicle.preflight() == []
        assert "comes home" in pair.vehicle.capabilities.alone
        assert list(state_folder.rglob("*.json"))
    assert values(pair) == OWN
    assert not list(state_folder.rglob("*.json"))


def test_what_is_set_already_is_left_alone(flight: Flight, state_folder: Path) -> None:
    """Nothing is written to a vehicle that comes home by its owner's own settings."""
    options = AutopilotOptions(
        family="ardupilot", ready_after=0.0, parameters={**OURS, "FS_GCS_ENABLE": 3.0}
    )
    with flight(options, fallback="set") as pair:
        assert pair.vehicle.preflight() == []
    assert not pair.heard("PARAM_SET")
    assert not state_folder.exists()


@pytest.mark.parametrize("policy", ["report", "require", "ignore"])
def test_nothing_is_changed_unasked(
    flight: Flight, policy: str, caplog: pytest.LogCaptureFixture
) -> None:
    """It is told, and with "require" it does not take off; only "set" sets."""
    with flight(ARDUPILOT, fallback=policy) as pair:
        reasons = pair.vehicle.preflight()
        assert any("FS_GCS_ENABLE is 0" in one for one in reasons) is (policy == "require")
        if policy == "require":
            with pytest.raises(VehicleError, match="would not come home without us"):
                pair.vehicle.take_off(2.0)
            assert not pair.autopilot.armed
        assert ("would not come home if this process died" in caplog.text) is (policy != "ignore")
        assert "hovers until a pilot lands it" in pair.vehicle.capabilities.alone
        pair.vehicle.close()
        assert not pair.heard("PARAM_SET")


def test_who_only_watches_changes_nothing(flight: Flight, state_folder: Path) -> None:
    """By the driver's own settings for that, over those of a flight that sets all there is."""
    wanted = {"fallback": "set", "failsafes": "set", "fence": "land"}
    with flight(ARDUPILOT, **{**wanted, **MavlinkVehicle.observing}).unconnected() as ends:
        held = ends.firmware.parameters.values
        before = dict(held)
        ends.vehicle.connect()
        assert held == before
        assert not any(ends.firmware.plans.plans.values())
        ends.vehicle.close()
        assert held == before
    assert not any(state_folder.rglob("*.json"))


def test_after_a_kill_the_next_flight_puts_it_back(
    flight: Flight, state_folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """With the values of before the first flight; a flight that sets nothing says what is due."""
    with flight(ARDUPILOT, fallback="set") as pair:
        pair.die()
        caplog.clear()
        with pair.again(fallback="report") as vehicle:
            assert vehicle.preflight() == []
        assert "FS_GCS_ENABLE 0" in caplog.text
        assert "--restore" in caplog.text
        assert values(pair) == OURS
        with pair.again(fallback="set", way_home="retrace"):
            assert values(pair) == {**OURS, "FS_GCS_ENABLE": 3.0}
        assert values(pair) == OWN
        assert not list(state_folder.rglob("*.json"))


def test_what_its_owner_sets_meanwhile_stays(flight: Flight) -> None:
    """By a ground station beside us: not our value any more, so not ours to put back."""
    with flight(ARDUPILOT, fallback="set") as pair:
        held = pair.autopilot.firmware.parameters.values
        held["FS_OPTIONS"] = 25.0
    assert values(pair) == {**OWN, "FS_OPTIONS": 25.0}


def test_in_flight_it_stays_set(flight: Flight) -> None:
    """What brings it home is not taken from it before it is home."""
    with flight(ARDUPILOT, fallback="set") as pair:
        connection = pair.vehicle.connection
        connection.commander.give(connection.autopilot.arm(), now=pair.now)
        pair.wait(lambda: pair.vehicle.read().armed)
        pair.vehicle.close()
        assert values(pair) == OURS


def test_older_firmware_has_other_names(flight: Flight) -> None:
    """ArduCopter before 4.7: SYSID_MYGCS, and heights in centimetres."""
    options = AutopilotOptions(
        family="ardupilot",
        parameters={"SYSID_MYGCS": 255.0, "RTL_ALT": 1500.0, "RTL_ALT_FINAL": 200.0},
    )
    limits = {"geofence": {"ceiling": 10.0}}
    with flight(options, fallback="set", limits=limits).unconnected() as ends:
        held = ends.firmware.parameters.values
        for name in ("MAV_GCS_SYSID", "MAV_GCS_SYSID_HI", "RTL_ALT_M", "RTL_ALT_FINAL_M"):
            held.pop(name)
        ends.vehicle.connect()
        changed = held["SYSID_MYGCS"], held["RTL_ALT"], held["RTL_ALT_FINAL"]
        assert changed == (245.0, 800.0, 0.0)
    assert (held["SYSID_MYGCS"], held["RTL_ALT"], held["RTL_ALT_FINAL"]) == (255.0, 1500.0, 200.0)


KEEPING_AWAY = {
    "ardupilot": [
        ("MAV_GCS_SYSID", 255.0, "does not notice our silence"),
        ("MAV_GCS_SYSID_HI", 255.0, "hide our silence"),
        ("FS_GCS_TIMEOUT", 30.0, "later than 5 s"),
        ("FS_GCS_ENABLE", 5.0, "does not come home"),
        ("FS_OPTIONS", 16.0, "a landing"),
        ("RTL_ALT_M", 130.0, "above the geofence's ceiling"),
        ("RTL_ALT_FINAL_M", 2.0, "hover over its home"),
    ],
    "px4": [
        ("COM_OBL_RC_ACT", 5.0, "hover"),
        ("COM_OF_LOSS_T", 30.0, "later than 5 s"),
        ("RTL_RETURN_ALT", 130.0, "above the geofence's ceiling"),
        ("RTL_LAND_DELAY", -1.0, "hover over its home"),
    ],
}


@pytest.mark.parametrize("family", ["ardupilot", "px4"])
def test_each_that_keeps_it_away_is_named(flight: Flight, family: str) -> None:
    """One at a time, with all others as they should be."""
    good = OURS if family == "ardupilot" else {"COM_OBL_RC_ACT": 3.0}
    options = AutopilotOptions(family=family, ready_after=0.0, parameters=good)  # type: ignore[arg-type]
    with flight(options, fallback="require") as pair:
        assert pair.vehicle.preflight() == []
        fallback = pair.vehicle.connection.fallback
        held = pair.autopilot.firmware.parameters.values
        for name, value, word in KEEPING_AWAY[family]:
            before, held[name] = held[name], value
            (reason,) = fallback.examine(120.0, "")
            assert f"{name} is {value:g}" in reason
            assert word in reason
            held[name] = before


def test_px4_flies_no_way_home_of_ours(flight: Flight) -> None:
    """Its mission return goes by the mission's progress: said, nothing is changed."""
    with (
        flight(AS_PX4, fallback="set", way_home="retrace").unconnected() as ends,
        pytest.raises(VehicleError, match=r'PX4 cannot fly this settings.way_home.*"return"'),
    ):
        ends.vehicle.connect()


def test_a_parameter_that_is_not_told_is_no_fallback(flight: Flight) -> None:
    """Unknown is not good, and nothing is set half."""
    with flight(ARDUPILOT, fallback="set").unconnected() as ends:
        ends.firmware.parameters.values.pop("FS_GCS_ENABLE")
        with pytest.raises(VehicleError, match="does not tell FS_GCS_ENABLE"):
            ends.vehicle.connect()
        held = ends.firmware.parameters.values
        assert held["MAV_GCS_SYSID"] == 255.0


def test_a_journal_that_cannot_be_read_stops_it(flight: Flight, state_folder: Path) -> None:
    """Rather than to forget what the vehicle was like."""
    with flight(ARDUPILOT, fallback="set") as pair:
        pair.die()
        (file,) = state_folder.rglob("*.json")
        file.write_text('{"parameters": {"FS_')
        wrong = pytest.raises(VehicleError, match="cannot be read: compare its parameters")
        with wrong, pair.again(fallback="set"):
            pass


def test_a_journal_that_cannot_be_written_changes_nothing(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """First it is kept, then it is changed."""

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(fallback, "write_private", full)
    with flight(ARDUPILOT, fallback="set").unconnected() as ends:
        with pytest.raises(VehicleError, match=r"so nothing is.*XDG_STATE_HOME"):
            ends.vehicle.connect()
        held = ends.firmware.parameters.values
        assert {name: held[name] for name in OWN} == OWN


def test_who_only_watches_puts_nothing_back(flight: Flight) -> None:
    """Nor does it, where a flight was killed: that is the next flight's to do."""
    with flight(ARDUPILOT, fallback="set") as pair:
        pair.die()
        with pair.again(fallback="set", **MavlinkVehicle.observing):
            pass
        assert values(pair) == OURS
        with pair.again(fallback="set"):
            pass
        assert values(pair) == OWN

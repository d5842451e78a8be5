"""A log over the mission clock: the line of the clocks, and whether it is of the same flight."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from flown_logs import Flown, dataflash, record_flown

from aerodaas.errors import RecordingError, UnknownIdError
from aerodaas.extensions.vehicle_logs.alignment import (
    RecordedClock,
    align,
    fit_clock_line,
    recorded_clocks,
    robot_of,
    starts_of,
)
from aerodaas.extensions.vehicle_logs.dataflash import read_dataflash
from aerodaas.extensions.vehicle_logs.log import VehicleLog
from aerodaas.recording.reader import Recording

FLOWN = Flown()


def clock_of(path: Path, flown: Flown, **settings: float | None) -> RecordedClock:
    """What the recording of a flight tells."""
    with Recording.open(record_flown(path / "flight.mcap", flown, **settings)) as opened:  # type: ignore[arg-type]
        return recorded_clocks(opened)["drone"]


def log_of(flown: Flown, begin: float = 0.0, end: float | None = None) -> VehicleLog:
    """Its log."""
    return read_dataflash(dataflash(flown, begin=begin, end=end))


def test_offset_and_drift_are_found_among_outliers() -> None:
    """A fifth of the pairs may be anywhere; the error tells how the others scatter."""
    rng = np.random.default_rng(3)
    mission = np.arange(0.0, 300.0, 0.1)
    clock = 1234.5 + (1.0 + 80e-6) * mission + rng.normal(0.0, 0.003, len(mission))
    clock[rng.random(len(mission)) < 0.2] += 20.0
    line = fit_clock_line(np.column_stack([mission, clock, np.full(len(mission), 0.001)]))
    assert line.offset == pytest.approx(1234.5, abs=0.002)
    assert line.drift == pytest.approx(80.0, abs=15.0)
    assert 0.004 < line.error < 0.010
    assert line.mission_time(np.array([1234.5 + 100.008])) == pytest.approx([100.0], abs=0.003)


def test_pairs_by_timesync_come_first() -> None:
    """The stamps of telemetry are late; so are exchanges over a slow link."""
    mission = np.arange(0.0, 60.0, 0.1)
    late = np.column_stack([mission, mission + 4.8, np.full(len(mission), np.nan)])
    slow = np.column_stack([mission, mission + 4.9, np.full(len(mission), 0.2)])
    good = np.column_stack([mission, mission + 5.0, np.full(len(mission), 0.001)])
    told = fit_clock_line(np.concatenate([late[:300], slow[300:440], good[440:]]))
    assert (round(told.offset, 6), told.synchronised) == (5.0, True)
    alone = fit_clock_line(late)
    assert (round(alone.offset, 6), alone.synchronised) == (4.8, False)
    assert "late by the link's delay" in str(alone)


def test_what_is_no_line_is_refused() -> None:
    """A clock that jumps hither and thither tells nothing."""
    mission = np.arange(0.0, 60.0, 0.1)
    jumps = 100.0 + mission + np.where(np.arange(600) % 3 == 0, 30.0, 0.0)
    with pytest.raises(RecordingError, match="runs on no line"):
        fit_clock_line(np.column_stack([mission, jumps, np.full(len(mission), 0.001)]))


def test_each_start_has_a_line_of_its_own() -> None:
    """The autopilot was restarted between two flights."""
    first = np.column_stack([np.arange(10.0), 50.0 + np.arange(10.0), np.zeros(10)])
    second = np.column_stack([20.0 + np.arange(10.0), 3.0 + np.arange(10.0), np.zeros(10)])
    found = starts_of(np.concatenate([first, second]))
    assert [len(one) for one in found] == [10, 10]
    assert [round(fit_clock_line(one).offset) for one in found] == [50, -17]


def test_a_log_lies_where_it_was_flown(tmp_path: Path) -> None:
    """Within the error that is told; it says which part of the flight it lacks."""
    told = align(log_of(FLOWN, 20.0, 50.0), clock_of(tmp_path, FLOWN))
    assert (told.begin, told.end) == pytest.approx((20.0, 50.0), abs=0.005)
    assert told.clock.drift == pytest.approx(50.0, abs=1.0)
    assert told.compared
    assert "covers 20.0 to 50.0 s of the mission, of the flight from 5.0 to 55.0 s" in str(told)
    assert "within 2 ms" in str(told)


def test_a_log_of_the_second_start_lies_there(tmp_path: Path) -> None:
    """By its motion: its clock alone would lie over the first one, too."""
    recorded = clock_of(tmp_path, FLOWN)
    again = Flown(zero=42.0, phase=2.0)
    (tmp_path / "again").mkdir()
    second = clock_of(tmp_path / "again", again)
    recorded.pairs += [(at + 100.0, clock, error) for at, clock, error in second.pairs]
    recorded.motion += [(at + 100.0, *rest) for at, *rest in second.motion]  # type: ignore[misc]
    assert align(log_of(FLOWN), recorded).begin == pytest.approx(0.0, abs=0.01)
    assert align(log_of(again), recorded).begin == pytest.approx(100.0, abs=0.01)


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (Flown(zero=500.0), "it runs from second 500 to 560 of the autopilot's clock"),
        (Flown(phase=3.0), "its speeds are not those of the recording"),
        (Flown(phase=1.2), "its speeds are not those of the recording"),
    ],
)
def test_a_log_of_another_flight_is_refused(tmp_path: Path, other: Flown, said: str) -> None:
    """At other seconds of the clock, or at the same ones on another way."""
    with pytest.raises(RecordingError, match=f"another flight: .*{re.escape(said)}.*aerodaas logs"):
        align(log_of(other), clock_of(tmp_path, FLOWN))


def test_a_clock_that_counts_from_1970_lies_over_its_stamps_of_32_bits(tmp_path: Path) -> None:
    """Simulated PX4s: time_boot_ms has begun anew hundreds of times."""
    simulated = Flown(zero=1_710_773_350.0)
    recorded = clock_of(tmp_path, simulated, error=None)
    anew = 2**32 / 1000
    recorded.pairs = [(at, clock % anew, error) for at, clock, error in recorded.pairs]
    told = align(log_of(simulated, 20.0, 50.0), recorded)
    assert (told.begin, told.end) == pytest.approx((20.0, 50.0), abs=0.01)
    with pytest.raises(RecordingError, match="another flight"):
        align(log_of(Flown(zero=simulated.zero + 500.0)), recorded)


def test_without_motion_the_clocks_tell(tmp_path: Path) -> None:
    """And that they alone do is said."""
    recorded = clock_of(tmp_path, FLOWN)
    recorded.motion = [(at, 0.0, 0.0, 0.0) for at, *_ in recorded.motion]
    log = log_of(FLOWN)
    still = VehicleLog(log.autopilot, log.span, {}, log.texts)
    told = align(still, recorded)
    assert not told.compared
    assert "compared by clocks alone" in str(told)
    recorded.motion = [(at, 9.0 * (at < 0.95), 0.0, 0.0) for at, *_ in recorded.motion]
    log.topics["velocity"].columns["east"][:] = 0.0
    log.topics["velocity"].columns["north"][:] = 0.0
    assert not align(log, recorded).compared, "a second of motion is too little to judge by"


def test_the_robot_is_the_only_one_with_a_clock(tmp_path: Path) -> None:
    """Of several it has to be said; one without an autopilot has no log."""
    path = record_flown(tmp_path / "flight.mcap", FLOWN, robots=("one", "two"))
    with Recording.open(path) as opened:
        clocks = recorded_clocks(opened)
    assert robot_of(clocks, "two") == "two"
    with pytest.raises(RecordingError, match=r"several autopilots \(one, two\): .*--robot"):
        robot_of(clocks, None)
    with pytest.raises(UnknownIdError, match="three"):
        robot_of(clocks, "three")
    clocks["one"].pairs.clear()
    assert robot_of(clocks, None) == "two"
    with pytest.raises(RecordingError, match="no clock of an autopilot"):
        robot_of(clocks, "one")


def test_a_clock_that_begins_without_end_is_refused() -> None:
    """A recording may be a stranger's: each start takes as long as the log is."""
    times = np.arange(0.0, 303.0, 1.0)
    recorded = RecordedClock([(now, 42.0 + 2.0 * (now % 3.0), np.nan) for now in times])
    recorded.motion = [(now, 0.0, 0.0, 0.0) for now in times]
    with pytest.raises(RecordingError, match="began 101 times, more than 100"):
        align(log_of(FLOWN), recorded)

"""Where a local frame lies: believed while places follow velocities, found again by the globe."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.drivers.mavlink.state.alignment import Alignment, global_origin
from aerodaas.drivers.mavlink.state.frames import Attitude, LocalFrame
from aerodaas.drivers.mavlink.state.telemetry import Telemetry
from aerodaas.geometry.frames import Vector

NORTH = 0.001
"""Degrees of latitude that are 111.2 m at 47 degrees north."""
EAST = 0.001
"""Degrees of longitude that are 76.1 m there."""


def vector(*values: float) -> Vector:
    """An array of floats."""
    return np.array(values, np.float64)


class Flying:
    """A vehicle 76.1 m east, 111.2 m north and 12 m above our zero, at 47 north and 8 east.

    Its local frame began 70 m east, 100 m north and 2 m above; zero is at 488 m above the sea.
    """

    def __init__(self, *, altitude: float | None = 500.0) -> None:
        self.telemetry = Telemetry()
        self.telemetry.place = (47.0 + NORTH, 8.0 + EAST)
        self.telemetry.altitude = altitude
        self.frame = LocalFrame(vector(70.0, 100.0, 2.0))
        self.telemetry.attitude = Attitude()
        self.telemetry.boot_time = 30.0
        self.telemetry.position = vector(11.2, 6.1, -10.0)
        self.alignment = Alignment(self.frame, self.telemetry)
        self.now = 130.0
        self.move(0.0)

    def move(self, seconds: float, *step: float, velocity: Vector | None = None) -> None:
        """Move by metres north, east, down within seconds of the autopilot's clock."""
        self.now += seconds
        telemetry = self.telemetry
        assert telemetry.position is not None
        telemetry.boot_time += seconds
        telemetry.position = telemetry.position + (vector(*step) if step else 0.0)
        telemetry.velocity = np.zeros(3) if velocity is None else velocity
        telemetry.position_at = telemetry.attitude_at = telemetry.heard_at = self.now
        self.alignment.move()

    def look(self, *, sure: bool = True) -> bool:
        """A global position comes; whether the frame is believed then."""
        self.alignment.place(self.now, sure=sure)
        return self.alignment.frame is not None

    def jump(self, *metres: float) -> None:
        """Have the local frame jump by so much north, east, down; the vehicle stays."""
        self.move(0.1, *metres)


def test_the_frame_knows_how_high_it_lies_above_the_sea() -> None:
    """By the autopilot's own altitude, which is none of GPS's above the ellipsoid."""
    assert Flying().alignment.sea_level == pytest.approx(488.0)
    assert Flying(altitude=None).alignment.sea_level is None


def test_zero_lies_where_the_globe_says() -> None:
    """As far south and west of the vehicle as it is north and east of zero."""
    origin = Flying().alignment.origin
    assert origin.latitude == pytest.approx(47.0, abs=1e-6)
    assert origin.longitude == pytest.approx(8.0, abs=1e-6)
    assert origin.altitude == 0.0
    here = global_origin(Flying().telemetry, LocalFrame(vector(-6.1, -11.2, 0.0)))
    assert (here.latitude, here.longitude) == pytest.approx((47.0 + NORTH, 8.0 + EAST), abs=1e-8)


@pytest.mark.parametrize(("miss", "lost"), [(2.04, False), (2.06, True)])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_within_a_tenth_of_a_second_a_place_may_be_off_by_two_metres(
    miss: float, axis: int, sign: float, *, lost: bool
) -> None:
    """And five centimetres, by which 10 m/s² could have moved it; on any axis, either way."""
    flight = Flying()
    step = [0.0, 0.0, 0.0]
    step[axis] = sign * miss
    flight.move(0.1, *step)
    assert (flight.alignment.frame is None) is lost
    assert flight.alignment.fault == ("position: jumped by 2 m" if lost else "")


@pytest.mark.parametrize(
    ("north", "lost"), [(11.9, False), (12.1, True), (-1.9, False), (-2.1, True)]
)
def test_a_velocity_leads_somewhere(north: float, *, lost: bool) -> None:
    """From 4 to 6 m/s within a second are 5 m; 7 m more or less are a leap."""
    flight = Flying()
    flight.move(0.1, velocity=vector(4.0, 0.0, 0.0))
    flight.move(1.0, north, 0.0, 0.0, velocity=vector(6.0, 0.0, 0.0))
    assert (flight.alignment.frame is None) is lost


def test_a_frame_is_found_again_after_two_seconds_that_agree() -> None:
    """Where the globe says, which is where the frame was less the jump; heights by the sea's."""
    flight = Flying()
    flight.jump(30.0, 40.0, -5.0)
    seen = []
    for _ in range(9):
        seen.append(flight.look())
        flight.move(0.25)
    assert seen == [False] * 8 + [True]
    frame = flight.alignment.frame
    assert frame is not None
    assert frame.origin == pytest.approx([30.0, 70.0, -3.0], abs=0.2)
    assert flight.telemetry.position is not None
    here = frame.position(flight.telemetry.position)
    assert here == pytest.approx([76.1, 111.2, 12.0], abs=0.2)


def test_the_frame_of_before_is_kept_if_it_is_the_same() -> None:
    """A jump there and back: within 3 m it is the very frame; a bit farther it is another."""
    for offset, same in ((2.9, True), (3.1, False)):
        flight = Flying()
        flight.jump(0.0, 50.0, 0.0)
        flight.jump(0.0, -50.0, 0.0)
        assert flight.telemetry.altitude is not None
        flight.telemetry.altitude += offset
        while not flight.look():
            flight.move(0.25)
        assert (flight.alignment.frame is flight.frame) is same


def test_global_positions_that_disagree_begin_anew() -> None:
    """More than 1.5 m from their middle: the two seconds count from the newest."""
    flight = Flying()
    flight.jump(30.0, 0.0, 0.0)
    for _ in range(7):
        assert not flight.look()
        flight.move(0.25)
    assert flight.telemetry.altitude is not None
    flight.telemetry.altitude += 4.0
    seen = []
    for _ in range(9):
        seen.append(flight.look())
        flight.move(0.25)
    assert seen == [False] * 8 + [True]
    frame = flight.alignment.frame
    assert frame is not None
    assert frame.origin[2] == pytest.approx(6.0, abs=0.1)


@pytest.mark.parametrize("doubt", ["unsure", "no place", "no altitude", "old position"])
def test_any_doubt_begins_the_two_seconds_anew(doubt: str) -> None:
    """The estimator's own, a globe that says nothing, a local position of a while ago."""
    flight = Flying()
    telemetry = flight.telemetry
    flight.jump(30.0, 0.0, 0.0)
    for _ in range(7):
        assert not flight.look()
        flight.move(0.25)
    if doubt == "no place":
        telemetry.place = None
    if doubt == "no altitude":
        telemetry.altitude = None
    if doubt == "old position":
        telemetry.position_at -= 1.0
    assert not flight.look(sure=doubt != "unsure")
    telemetry.place, telemetry.altitude = (47.0 + NORTH, 8.0 + EAST), 500.0
    flight.move(0.25)
    seen = []
    for _ in range(9):
        seen.append(flight.look())
        flight.move(0.25)
    assert seen == [False] * 8 + [True]


def test_a_jump_is_told_for_ten_seconds_after_it_was_mended() -> None:
    """Long enough to be read."""
    flight = Flying()
    flight.jump(30.0, 0.0, 0.0)
    while not flight.look():
        flight.move(0.25)
    mended = flight.now
    flight.now = mended + 10.0
    flight.look()
    assert flight.alignment.fault == "position: jumped by 30 m"
    flight.now = mended + 10.1
    flight.look()
    assert flight.alignment.fault == ""
    assert flight.alignment.frame is not None


def test_a_vehicle_that_stood_is_where_it_stood() -> None:
    """Whatever the new frame says, and however often it starts anew before it says anything."""
    flight = Flying()
    flight.alignment.restart(stands=True)
    assert (flight.alignment.frame, flight.alignment.fault) == (None, "")
    flight.alignment.restart(stands=True)
    flight.telemetry.position = vector(0.5, 0.25, 0.0)
    flight.telemetry.boot_time = 2.0
    flight.move(0.0)
    frame = flight.alignment.frame
    assert frame is not None
    assert frame.position(vector(0.5, 0.25, 0.0)) == pytest.approx([76.1, 111.2, 12.0])
    flight.move(0.1, 1.0, 0.0, 0.0)
    assert flight.alignment.frame is frame, "and from there on it flies as ever"
    assert frame.position(vector(1.5, 0.25, 0.0)) == pytest.approx([76.1, 112.2, 12.0])


def test_a_vehicle_that_flew_is_looked_for_by_the_globe() -> None:
    """The first place of its new frame is no leap, and none of the old is believed."""
    flight = Flying()
    flight.alignment.restart(stands=False)
    words = "position: not believed, its local frame is a new one"
    assert (flight.alignment.frame, flight.alignment.fault) == (None, words)
    assert not flight.look(), "it has not said where it is"
    flight.telemetry.position, flight.telemetry.boot_time = vector(0.0, 0.0, 0.0), 1.0
    flight.move(0.0)
    assert flight.alignment.fault == words
    while not flight.look():
        flight.move(0.25)
    frame = flight.alignment.frame
    assert frame is not None
    assert frame.origin == pytest.approx([76.1, 111.2, 12.0], abs=0.2)

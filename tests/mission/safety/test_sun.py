"""The height of the sun, against what is known of it."""

from __future__ import annotations

from datetime import datetime, timezone

import pytest

from aerodaas.mission.safety.checklist import sun_elevation


def at(latitude: float, longitude: float, when: str) -> float:
    """Degrees above the horizon."""
    moment = datetime.fromisoformat(when).replace(tzinfo=timezone.utc)
    return sun_elevation(latitude, longitude, moment.timestamp())


@pytest.mark.parametrize(
    ("when", "declination"),
    [
        ("2024-03-20T03:06", 0.0),
        ("2024-06-20T20:51", 23.44),
        ("2024-09-22T12:44", 0.0),
        ("2024-12-21T09:20", -23.44),
        ("2050-03-20T10:19", 0.0),
    ],
)
def test_over_the_pole_it_stands_as_high_as_its_declination(when: str, declination: float) -> None:
    """At equinoxes and solstices (US Naval Observatory)."""
    for longitude in (0.0, 120.0):
        assert at(90.0, longitude, when) == pytest.approx(declination, abs=0.03)
        assert at(-90.0, longitude, when) == pytest.approx(-declination, abs=0.03)


@pytest.mark.parametrize(
    ("latitude", "longitude", "when"),
    [
        (47.37, 8.54, "2027-01-15T07:08"),
        (-35.28, 149.13, "2026-11-26T09:00"),
        (40.71, -74.01, "2024-07-04T09:30"),
    ],
)
def test_it_rises_and_sets_when_almanacs_say(latitude: float, longitude: float, when: str) -> None:
    """0.83 degrees under the horizon, for refraction and its radius; the hour is of a minute."""
    assert at(latitude, longitude, when) == pytest.approx(-0.83, abs=0.6)


def test_noon_is_in_the_south_of_the_north() -> None:
    """At Greenwich's midsummer, by latitude and declination alone."""
    assert at(51.4779, 0.0, "2020-06-20T12:01:30") == pytest.approx(61.96, abs=0.03)
    assert at(51.4779, 0.0, "2020-06-21T00:01:30") == pytest.approx(-15.09, abs=0.03)

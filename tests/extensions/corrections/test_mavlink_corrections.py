"""A base station's corrections on their way to the vehicles."""

from __future__ import annotations

import logging
import time
from types import SimpleNamespace
from typing import Any

import pytest
from emulated import Flight
from routed import routed
from rtcm_station import BaseStation, rtcm
from waiting import until

from aerodaas.errors import ConfigError
from aerodaas.extensions.corrections import corrections as module
from aerodaas.extensions.corrections.corrections import Corrections

MESSAGE = rtcm(bytes(range(200)))


def _content(parts: list[Any]) -> bytes:
    return b"".join(bytes(part.data[: part.len]) for part in parts)


def test_what_the_station_says_is_passed_on() -> None:
    """Without the noise between."""
    got: list[Any] = []
    with BaseStation() as station:
        source = Corrections(station.url, "d", got.append)
        try:
            station.say(b"noise" + MESSAGE[:50])
            station.say(MESSAGE[50:] + b"$GPGGA,,*00\r\n" + MESSAGE)
            until(lambda: source.passed == 2)
        finally:
            source.close()
    assert _content(got) == 2 * MESSAGE
    assert source.skipped == 5 + 13
    assert source.reports(time.monotonic()) == []


def test_a_station_that_goes_and_comes_back_is_heard_again() -> None:
    """And one that is not there yet is waited for."""
    with BaseStation() as first:
        port = first.port
    source = Corrections(f"tcp:127.0.0.1:{port}", "d", lambda _: None)
    try:
        with BaseStation(port) as station:
            station.say(MESSAGE)
            until(lambda: source.passed == 1)
            station.hang_up()
            station.say(MESSAGE)
            until(lambda: source.passed == 2)
    finally:
        source.close()


def test_silence_is_told_until_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """In words that stay the same, so that they are told once."""
    offset = 0.0
    clock = SimpleNamespace(monotonic=lambda: time.monotonic() + offset)
    monkeypatch.setattr(module, "time", clock)
    with BaseStation() as station:
        source = Corrections(station.url, "d", lambda _: None)
        try:
            assert source.reports(clock.monotonic() + 9.0) == []
            words = [f"corrections: none from {station.url}"]
            assert source.reports(clock.monotonic() + 11.0) == words
            assert source.reports(clock.monotonic() + 60.0) == words
            offset = 60.0
            station.say(b"noise is no correction")
            station.say(MESSAGE)
            until(lambda: source.passed == 1)
            assert source.reports(clock.monotonic() + 1.0) == []
        finally:
            source.close()


def test_what_is_too_much_or_too_large_is_left_out_and_told() -> None:
    """The vehicle's link carries orders first."""
    got: list[Any] = []
    with BaseStation() as station:
        source = Corrections(station.url, "d", got.append)
        try:
            station.say(rtcm(bytes(1000)) + 100 * MESSAGE)
            until(lambda: source.passed + source.left_out == 101)
        finally:
            source.close()
        assert source.left_out > 50
        assert source.passed >= 5000 // len(MESSAGE)
        assert _content(got) == source.passed * MESSAGE
        told = source.reports(time.monotonic())
        assert told == [f"corrections: more from {station.url} than is passed on"]


@pytest.mark.parametrize("url", ["udpin:127.0.0.1:2101", "ntrip:host:1", "base"])
def test_an_address_that_is_none_is_refused(url: str) -> None:
    """With what it may be."""
    with pytest.raises(ConfigError, match="d: corrections come from tcp:HOST:PORT or serial"):
        Corrections(url, "d", lambda _: None)


def test_a_station_on_the_network_is_warned_of(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing signs what it says."""
    monkeypatch.setattr(module, "is_exposed", lambda _: True)
    with BaseStation() as station, caplog.at_level(logging.WARNING):
        Corrections(station.url, "d", lambda _: None).close()
    assert "nothing signs them" in caplog.text


def test_corrections_reach_each_vehicle_behind_a_router_once(flight: Flight) -> None:
    """All that the router carries was sent to each, and each has taken its own."""
    message = rtcm(bytes(range(200)))
    with BaseStation() as base, routed(flight, 1, 2, corrections=base.url) as (ends, _):
        left, right = ends
        base.say(message)
        left.wait(
            lambda: (
                right.vehicle.read(),
                all(len(one.heard("GPS_RTCM_DATA")) >= 2 for one in ends),
            )[1],
            60.0,
        )
        for one in ends:
            parts = one.heard("GPS_RTCM_DATA")
            assert b"".join(bytes(part.data[: part.len]) for part in parts) == message

"""The emulated Tello keeps to the SDK: ranges, replies, silence, refusals."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.vehicle import VehicleMode
from aerodaas.testing.channel import Channel
from tools.tello_vehicle import EmulatedTello, Impairment, TelloOptions, VideoOptions
from tools.tello_vehicle.flight import TelloFlight
from tools.tello_vehicle.sdk import TelloSdk

pytestmark = pytest.mark.wall_clock


@pytest.fixture
def sdk() -> TelloSdk:
    """A Tello's ear, in SDK mode and in the air, whose time stands still."""
    flight = TelloFlight(TelloOptions())
    ear = TelloSdk(TelloOptions(), flight)
    ear.handle("command")
    ear.handle("takeoff")
    flight.advance(5.0)
    assert flight.settled
    return ear


@pytest.mark.parametrize(
    ("text", "reply"),
    [
        ("up 19", "out of range"),
        ("up 501", "out of range"),
        ("forward", "out of range"),
        ("cw 0", "out of range"),
        ("ccw 361", "out of range"),
        ("go 20 20 20 50", "out of range"),
        ("go 0 21 0 9", "out of range"),
        ("go 501 0 0 50", "out of range"),
        ("curve 0 0 30 30 0 60 61", "out of range"),
        ("curve 50 0 0 100 0 0 30", "error Radius is too large!"),
        ("speed 101", "out of range"),
        ("port 80 11111", "out of range"),
        ("forward x", "error: forward x"),
        ("dance", "unknown command: dance"),
        ("sdk?", "30"),
        ("stop", "ok"),
        ("takeoff", "error"),
    ],
)
def test_what_is_out_of_range_is_refused(sdk: TelloSdk, text: str, reply: str) -> None:
    """Ranges are those of the user guides, and nothing moves for a refusal."""
    outcome = sdk.handle(text)
    assert outcome.reply == reply
    assert not outcome.moves


@pytest.mark.parametrize(
    ("text", "way"),
    [
        ("forward 100", (1.0, 0.0, 0.0)),
        ("back 100", (-1.0, 0.0, 0.0)),
        ("left 100", (0.0, 1.0, 0.0)),
        ("right 100", (0.0, -1.0, 0.0)),
        ("up 50", (0.0, 0.0, 0.5)),
        ("down 30", (0.0, 0.0, -0.3)),
        ("go 50 -60 20 40", (0.5, -0.6, 0.2)),
    ],
)
def test_moves_are_made_in_its_own_frame(text: str, way: tuple[float, float, float]) -> None:
    """It looks east here, so that forward is east and left is north."""
    options = TelloOptions()
    flight = TelloFlight(options)
    ear = TelloSdk(options, flight)
    for command in ("command", "takeoff"):
        ear.handle(command)
    flight.advance(5.0)
    before = flight.truth.position
    assert ear.handle(text).moves
    assert ear.handle("up 20").reply == "error Not joystick", "one motion at a time"
    flight.advance(8.0)
    assert flight.settled
    assert flight.truth.position - before == pytest.approx(way, abs=0.15)


@given(st.text(max_size=60))
def test_no_text_upsets_it(text: str) -> None:
    """Whatever is said, it answers or it does not."""
    options = TelloOptions()
    flight = TelloFlight(options)
    ear = TelloSdk(options, flight)
    if text.split():
        ear.handle(text)
        ear.handle("command")
        ear.handle(text)
    flight.advance(0.05)


def test_nothing_is_understood_before_command() -> None:
    """SDK mode must be entered first."""
    options = TelloOptions()
    ear = TelloSdk(options, TelloFlight(options))
    assert ear.handle("takeoff").reply is None
    assert not ear.handle("takeoff").moves


@pytest.fixture
def client() -> Iterator[socket.socket]:
    """A client's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as opened:
        opened.settimeout(10.0)
        yield opened


@pytest.mark.slow
def test_it_lands_after_15_seconds_of_silence(client: socket.socket) -> None:
    """And not before, however it was flown."""
    with EmulatedTello() as tello:
        for text in (b"command", b"takeoff"):
            client.sendto(text, ("127.0.0.1", tello.port))
            assert client.recv(100) == b"ok"
        client.sendto(b"rc 0 20 0 0", ("127.0.0.1", tello.port))
        time.sleep(13.0)
        assert tello.mode is VehicleMode.GUIDED, "it flies on as the last rc said"
        time.sleep(4.0)
        assert tello.mode in {VehicleMode.LANDING, VehicleMode.GROUNDED}


def test_low_battery_refuses_take_off(client: socket.socket) -> None:
    """With the words that users know."""
    with EmulatedTello(TelloOptions(battery=0.05)) as tello:
        replies = []
        for text in (b"command", b"battery?", b"takeoff"):
            client.sendto(text, ("127.0.0.1", tello.port))
            replies.append(client.recv(100))
    assert replies == [b"ok", b"5", b"error Motor stop"]


def test_it_takes_the_place_of_an_environments_robot() -> None:
    """It stands, looks and films as the file says, and stays the Tello that it was otherwise."""
    environment = EnvironmentConfig.model_validate(
        {
            "robots": [
                {
                    "id": "tello",
                    "start": [1, 2, 0],
                    "start_yaw": 90,
                    "sensors": [{"id": "eye", "settings": {"pitch": 12}}],
                }
            ],
            "simulation": {"world": "rescue", "seed": 3, "wind": [0.3, 0.2, 0], "gust": 0.2},
        }
    )
    options = TelloOptions(battery=0.5, video=VideoOptions(rate=10.0)).placed(environment)
    truth = TelloFlight(options).truth
    assert tuple(truth.position) == (1, 2, 0)
    assert truth.yaw == pytest.approx(math.pi / 2)
    assert (options.battery, options.seed, options.wind[0], options.gust) == (0.5, 3, 0.3, 0.2)
    video = options.video
    assert (video.world, video.seed, video.pitch, video.rate) == ("rescue", 3, 12.0, 10.0)


def test_a_channel_loses_doubles_and_delays_by_its_seed() -> None:
    """The same seed spoils the same packets, in about the share that was asked for."""

    def run() -> list[bytes]:
        arrived: list[bytes] = []
        bad = Impairment(loss=0.2, duplicates=0.1, late=0.1, lateness=50.0)
        channel = Channel(bad, "seed", lambda content, _: arrived.append(content))
        for index in range(1000):
            channel.send(str(index).encode(), ("", 0), float(index))
            channel.deliver(float(index))
        channel.deliver(1e9)
        return arrived

    arrived = run()
    assert arrived == run()
    assert 820 <= len(arrived) <= 940
    assert arrived != sorted(arrived, key=int), "late ones were overtaken"

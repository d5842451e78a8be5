"""Analyses at the user's side: the mission is flown elsewhere, their code is in another process."""

from __future__ import annotations

import re
import runpy
import socket
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np
import pytest
from flying import FLAT, Flyer, recorded

from aerodaas import Environment
from aerodaas.analytics.here.analysis import HereSite
from aerodaas.analytics.here.relay import Channel, ChannelError, HereRelay
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.environment.document.building import build_mission
from aerodaas.errors import MissionError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

USER = Path(__file__).with_name("here_user.py")
APPLICATION = '''
"""Flies a circle by velocities of its own, and lands on a word of its own about the height."""

import math

from aerodaas import AeroNavigation, Analytics, Environment, NavigationType, Odometry
from aerodaas import VelocityCommand
from aerodaas.analytics import MonitoringAnalytics, NavigableAnalytics


class Leg:
    """A class that this file alone knows."""

    def __init__(self, number, yaw):
        self.number = number
        self.yaw = yaw


class Legs(Analytics[Leg]):
    """Counts the odometry, and remembers where it looked."""

    accepts = (Odometry,)

    def __init__(self):
        self.count = 0

    def process(self, item, context):
        self.count += 1
        return Leg(self.count, item.yaw)


class Circle(NavigableAnalytics):
    """Ever faster, with a wind from the vehicle's own state."""

    accepts = (Leg,)

    def process(self, item, context):
        battery = context.vehicle().battery.fraction
        forward = 1.0 + 0.01 * item.number + 0.1 * battery
        command = VelocityCommand(forward, 0.0, 0.2 + 0.1 * math.sin(item.number / 10), 0.4)
        return AeroNavigation(NavigationType.ANALYTICS_DRIVEN, [command])


env = Environment("environment.json")
drone = env.get_robot_by_id("drone")
odometry = drone.get_sensor_by_id("odom_drone").get_data_stream()
circle = Circle()
drone.navigate(circle.generate_navigation(Legs().analyse(odometry)))
watch = MonitoringAnalytics(["height"]).deploy(env.get_compute_resource_by_id("edge"))
watch.trigger(drone.end_mission, when=lambda seen: seen.values["height"] > 2.5)
watch.analyse(odometry)
drone.start_mission()
'''


class User:
    """A user's process, and its connection with the relay of a flight."""

    def __init__(self, folder: Path, application: Path, how: str) -> None:
        """Start the process, which compiles `application`."""
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        listener.bind(str(folder / "user.sock"))
        listener.listen(1)
        command = [sys.executable, str(USER), str(application), str(folder / "user.sock"), how]
        self.process = subprocess.Popen(command)
        with listener:
            listener.settimeout(60.0)
            connection, _ = listener.accept()
        self._channel = Channel(connection)
        content, _ = self._channel.receive(60.0)
        self.document = MissionDocument.model_validate(content["document"])

    @contextmanager
    def joined(self, folder: Path) -> Iterator[HereRelay]:
        """The relay of a flight, with this user attached."""
        relay = HereRelay(folder / "here.sock", seconds=1.0)
        relay.start()
        user = relay.attach(self._channel.send)

        def listen() -> None:
            with suppress(ChannelError):
                while True:
                    user.answered(*self._channel.receive())
            user.detach()

        threading.Thread(target=listen, daemon=True).start()
        try:
            yield relay
        finally:
            relay.close()
            self._channel.close()
            self.process.kill()
            self.process.wait()


def fly(flyer: Flyer, how: str = "", said: str = "") -> tuple[RecordedFlight, HereRelay]:
    """Fly the application's document with its user in a process that misbehaves.

    `said` is told of the user's side then.
    """
    application = flyer.folder / "application.py"
    flyer.write(FLAT)
    application.write_text(textwrap.dedent(APPLICATION))
    user = User(flyer.folder, application, how)
    with (
        user.joined(flyer.folder) as relay,
        flyer.options(record=flyer.folder / "provider", simulated_time=True, seed=5),
    ):
        environment = Environment(flyer.folder / "environment.json")
        build_mission(user.document, environment, flyer.folder, HereSite(relay.path))
        run = environment.launch()
        # As in any flight, what an analysis raised is told at the end.
        with pytest.raises(MissionError, match=said) if said else nullcontext():
            run.wait()
    return recorded(run), relay


def test_it_flies_as_the_application_does(flyer: Flyer) -> None:
    """In simulated time, with one seed: the same trajectory, to the last digit."""
    theirs, relay = fly(flyer)
    application = flyer.folder / "application.py"
    with flyer.options(
        record=flyer.folder / "own", simulated_time=True, seed=5, application=application
    ):
        runpy.run_path(str(application), run_name="__main__")
    with Recording.open(flyer.folder / "own" / "flight.mcap") as recording:
        own = RecordedFlight.read(recording)
    (here,), (there,) = own.robots.values(), theirs.robots.values()
    assert here.outcome == there.outcome
    assert "landed" in here.outcome
    assert here.time[-1] < 30, "ended by the user's condition, not by an empty battery"
    assert len(here.position) > 100
    np.testing.assert_array_equal(here.position, there.position)
    times = relay.times()
    assert set(times) == {"drone/legs", "drone/circle", "drone/monitoring"}
    assert all(one.answers > 30 and not one.missed for one in times.values())
    assert all(0 < one.at_work < one.total for one in times.values())
    # The way to the user and back is in the latency that is recorded for every analysis.
    at_work = theirs.latencies["drone/circle"].work["drone/circle"]
    assert sum(at_work) >= 1000 * 0.5 * times["drone/circle"].total


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ("killed", "user's side has left"),
        pytest.param("hung", r"no answer in 1 s", marks=pytest.mark.slow),
    ],
)
def test_the_drone_comes_home_without_its_user(flyer: Flyer, how: str, said: str) -> None:
    """By the rule of silent navigation; each analysis tells it once."""
    flight, relay = fly(flyer, how, said)
    (drone,) = flight.robots.values()
    assert "landed" in drone.outcome
    reasons = [band.reason for band in drone.bands]
    assert any("navigation has been silent" in one for one in reasons)
    assert np.linalg.norm(drone.position[-1][:2]) < 1.0
    told = [text for _, kind, text in flight.alerts if kind == "analysis_failed"]
    for name in ("drone/legs", "drone/circle", "drone/monitoring"):
        assert sum(f"{name} has no results" in text for text in told) <= 1
    assert any(re.search(said, text) for text in told)
    assert relay.times()["drone/legs"].missed > 10

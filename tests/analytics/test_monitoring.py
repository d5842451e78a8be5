"""Monitoring: the readings asked for, and where state and odometry disagree."""

from __future__ import annotations

import numpy as np
import pytest

from aerodaas.analytics.base import ComputeKind
from aerodaas.analytics.monitoring.analytics import MonitoringAnalytics
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import UnknownIdError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.mission import MissionState, MissionStatus
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.messages.waypoints import Waypoint


class Desk:
    """A context that keeps what it is told."""

    def __init__(self) -> None:
        """Start at zero with a full battery."""
        self.stamp = 0
        self.kind: ComputeKind = "edge"
        self.alerts: list[Alert] = []
        self.state: VehicleState | None = None

    def now(self) -> int:
        """Mission clock."""
        return self.stamp

    def vehicle(self) -> VehicleState | None:
        """The newest state."""
        return self.state

    def alert(self, alert: Alert) -> None:
        """Keep it."""
        self.alerts.append(alert)

    @property
    def kinds(self) -> list[str]:
        """Kinds of the alerts so far."""
        return [alert.kind for alert in self.alerts]


def odometry(height: float = 1.5, speed: float = 0.0, east: float = 0.0) -> Odometry:
    """A drone somewhere."""
    return Odometry(np.array([east, 0.0, height]), np.array([speed, 0.0, 0.0]), 0.5)


def watch(
    monitor: MonitoringAnalytics, desk: Desk, state: MissionState, seen: Odometry, duration: float
) -> None:
    """Feed the same state and odometry for some seconds."""
    target = Waypoint("wp1", 0, 0, 1.5, waypoint_type="local")
    for _ in range(int(duration * 10)):
        desk.stamp += NANOSECONDS // 10
        monitor.process(MissionStatus(desk.stamp, state, target=target), desk)
        monitor.process(seen, desk)


def test_only_the_readings_asked_for() -> None:
    """Known values by name, from odometry and from the vehicle's own state."""
    desk, monitor = Desk(), MonitoringAnalytics(["battery", "height", "gps"])
    fix = GpsFix(48.0, 11.0, 500.0)
    desk.state = VehicleState(0, odometry(), Battery(0.8), VehicleMode.GUIDED, armed=True, gps=fix)
    readings = monitor.process(odometry(height=2.0, speed=3.0), desk)
    assert readings.values == {
        "battery": 0.8,
        "height": 2.0,
        "gps.latitude": 48.0,
        "gps.longitude": 11.0,
        "gps.altitude": 500.0,
    }


def test_camera_rate() -> None:
    """From the stamps of the frames."""
    desk, monitor = Desk(), MonitoringAnalytics(["camera"])
    picture = np.zeros((2, 2, 3), np.uint8)
    first, second = (Header(i, i * NANOSECONDS // 15, "drone/cam") for i in range(2))
    monitor.process(Frame(first, picture), desk)
    readings = monitor.process(Frame(second, picture), desk)
    assert readings.values["camera.rate"] == pytest.approx(15.0)


def test_an_unknown_reading_is_refused_by_name() -> None:
    """With the names there are."""
    with pytest.raises(UnknownIdError, match=r"altimeter.*height"):
        MonitoringAnalytics(["altimeter"])


def test_low_battery_is_told_once() -> None:
    """And again only after it was well in between."""
    desk, monitor = Desk(), MonitoringAnalytics()
    for charge in (0.5, 0.2, 0.19, 0.5, 0.2):
        monitor.process(Battery(charge), desk)
    assert desk.kinds == ["battery_low", "battery_low"]


@pytest.mark.parametrize(
    ("state", "seen", "kind"),
    [
        (MissionState.HOLDING, odometry(speed=2.0), "still"),
        (MissionState.LOITERING, odometry(east=5.0), "place"),
        (MissionState.ENROUTE, odometry(), "moving"),
        (MissionState.LANDED, odometry(height=9.0), "ground"),
    ],
)
def test_contradictions_are_told_after_a_while(
    state: MissionState, seen: Odometry, kind: str
) -> None:
    """Each contradiction between stat-stream and odometry, not in its first moment."""
    desk, monitor = Desk(), MonitoringAnalytics(["height"], patience=2.0)
    watch(monitor, desk, MissionState.IDLE, odometry(height=0.0), 1.0)
    watch(monitor, desk, state, seen, 1.5)
    assert kind not in desk.kinds
    watch(monitor, desk, state, seen, 1.0)
    assert desk.kinds == [kind]
    assert state.value in desk.alerts[0].text or "loiters" in desk.alerts[0].text


def test_agreement_is_silent() -> None:
    """Hovering at the waypoint, flying between waypoints: nothing to say."""
    desk, monitor = Desk(), MonitoringAnalytics()
    watch(monitor, desk, MissionState.IDLE, odometry(height=0.0), 1.0)
    watch(monitor, desk, MissionState.LOITERING, odometry(speed=0.1), 5.0)
    watch(monitor, desk, MissionState.ENROUTE, odometry(speed=1.0), 5.0)
    assert not desk.alerts


def test_gps_that_drifts_off_is_told() -> None:
    """Measured from the first fix on."""
    desk, monitor = Desk(), MonitoringAnalytics(["gps"])
    origin = GeodeticOrigin(48.0, 11.0, 500.0)
    monitor.process(odometry(), desk)
    for drift in (0.0, 2.0, *[15.0] * 30):
        desk.stamp += NANOSECONDS // 10
        monitor.process(GpsFix(*origin.to_geodetic(np.array([drift, 0.0, 0.0]))), desk)
        monitor.process(odometry(), desk)
    assert desk.kinds == ["gps"]

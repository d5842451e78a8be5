"""From the first word to a vehicle that knows where it is: how long, and where its frame lies."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from aerodaas.config.model import RobotConfig
from aerodaas.drivers.mavlink import connecting
from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.connecting import CHECKS, Connection, establish
from aerodaas.drivers.mavlink.microservices.commander import Commander
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.state.telemetry import Sensors, Telemetry
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.types.errors import VehicleError
from aerodaas.types.geometry import GeodeticOrigin

CHECK = mavlink.MAV_SYS_STATUS_PREARM_CHECK
HOME = GeodeticOrigin(47.0, 8.0, 500.0)
VERSION, CHECKING = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_RUN_PREARM_CHECKS


class Meeting:
    """A vehicle that stands 111.2 m north of home, at 10 north, 20 east, -3 down of its own frame.

    Each pause lasts a quarter of a second, in which it speaks, and does what it is told to.
    """

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **settings: Any) -> None:  # noqa: ANN401
        self.now = 100.0
        self.settings = MavlinkSettings(**{"fallback": "ignore", **settings})
        self.telemetry = Telemetry()
        self.telemetry.beat_at = 99.0
        self.telemetry.software = "4.7.0"
        self.telemetry.place, self.telemetry.altitude = (47.001, 8.0), 488.0
        self.telemetry.position = np.array([10.0, 20.0, -3.0])
        self.telemetry.sensors = Sensors(CHECK, CHECK, CHECK)
        self.autopilot: Autopilot = ArduPilot()
        self.sent: list[tuple[float, Any]] = []
        self.deeds: dict[float, Callable[[], None]] = {}
        self.fences: list[tuple[Any, ...]] = []
        self.unsafe: list[Any] = []
        self.set: list[tuple[str, float]] = []
        self.asked: list[Any] = []
        self.speaks = True
        clock = SimpleNamespace(monotonic=lambda: self.now)
        parameters = SimpleNamespace(set=lambda name, value: self.set.append((name, value)))

        def judged(*of: object) -> list[Any]:
            self.asked.append(of)
            return self.unsafe

        for name, fake in (
            ("time", clock),
            ("Parameters", lambda *_: parameters),
            ("unsafe_parameters", judged),
            ("upload_fence", lambda *of: self.fences.append(of)),
        ):
            monkeypatch.setattr(connecting, name, fake)
        self.link = SimpleNamespace(target=(7, 1))
        self._speak()

    def _speak(self) -> None:
        if self.speaks:
            self.telemetry.position_at = self.telemetry.attitude_at = self.now
            self.telemetry.heard_at = self.now

    def _pause(self) -> None:
        self.now += 0.25
        self._speak()
        self.deeds.pop(self.now, lambda: None)()

    def establish(self, home: GeodeticOrigin | None = None, **robot: Any) -> Connection:  # noqa: ANN401
        """Meet it."""
        commander = Commander(lambda sent: self.sent.append((self.now, sent)), (7, 1), 245)
        self.commander, self.departure = commander, SimpleNamespace()
        return establish(
            self.link,  # type: ignore[arg-type]
            self.autopilot,
            commander,
            self.departure,  # type: ignore[arg-type]
            self.telemetry,
            robot=RobotConfig.model_validate({"id": "d", "driver": "mavlink", **robot}),
            settings=self.settings,
            home=home,
            pause=self._pause,
        )

    def orders(self, number: int) -> list[float]:
        """When it got an order of this number."""
        return [at for at, one in self.sent if one.command == number]


@pytest.fixture
def meeting(monkeypatch: pytest.MonkeyPatch) -> Meeting:
    """One that is ready at once."""
    return Meeting(monkeypatch)


def test_a_vehicle_that_is_ready_is_met_at_once(
    meeting: Meeting, caplog: pytest.LogCaptureFixture
) -> None:
    """Asked for its version; what was put together is what flies it."""
    caplog.set_level("INFO", "aerodaas.drivers.mavlink.connecting")
    meeting.telemetry.software = "4.5.7"
    connection: Any = meeting.establish()
    assert meeting.now == 100.0
    assert meeting.orders(VERSION) == [100.0]
    assert connection.link is meeting.link
    assert connection.autopilot is meeting.autopilot
    assert connection.commander is meeting.commander
    assert connection.departure is meeting.departure
    assert connection.target == (7, 1)
    assert caplog.messages[-1] == "d: ArduPilot 4.5.7, system 7"
    assert meeting.fences == []


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (4.0, 5.0, 6.0)])
def test_where_it_stands_is_its_start(meeting: Meeting, start: tuple[float, float, float]) -> None:
    """Whatever its own frame, and home, say: 10 m further north of it is 10 m further north."""
    for home in (None, HOME):
        frame = meeting.establish(home, start=start).alignment.frame
        assert frame is not None
        east, north, up = start
        assert frame.position(np.array([10.0, 20.0, -3.0])) == pytest.approx([east, north, up])
        assert frame.position(np.array([20.0, 20.0, -4.0])) == (
            pytest.approx([east, north + 10.0, up + 1.0])
        )


def test_a_frame_that_is_laid_over_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """By its latitude and longitude; the height is the start's. Without a home it is the start."""
    meeting = Meeting(monkeypatch, frame="home")
    frame = meeting.establish(HOME, start=(4.0, 5.0, 6.0)).alignment.frame
    assert frame is not None
    here = np.array([10.0, 20.0, -3.0])
    assert frame.position(here) == pytest.approx([0.0, 111.2, 6.0], abs=0.1)
    frame = meeting.establish(None, start=(4.0, 5.0, 6.0)).alignment.frame
    assert frame is not None
    assert frame.position(here) == pytest.approx([4.0, 5.0, 6.0])


def test_a_vehicle_in_the_air_took_off_from_its_start(meeting: Meeting) -> None:
    """Its home, by its own word, is the start; and neither failsafes nor fences are touched."""
    meeting.telemetry.armed = True
    meeting.telemetry.home = np.array([9.0, 18.0, 1.0])
    meeting.telemetry.sensors = Sensors(CHECK, CHECK, 0)
    frame = meeting.establish(HOME, start=(4.0, 5.0, 6.0)).alignment.frame
    assert frame is not None
    assert frame.position(np.array([9.0, 18.0, 1.0])) == pytest.approx([4.0, 5.0, 6.0])
    assert frame.position(np.array([10.0, 20.0, -3.0])) == pytest.approx([6.0, 6.0, 10.0])
    assert meeting.now == 100.0, "it is not asked whether it would arm"
    assert meeting.asked == []


def test_over_home_a_vehicle_in_the_air_is_as_high_as_it_rose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """4 m above its home, which is the 6 m of its start."""
    meeting = Meeting(monkeypatch, frame="home", fence="return")
    meeting.telemetry.armed = True
    meeting.telemetry.home = np.array([9.0, 18.0, 1.0])
    frame = meeting.establish(HOME, start=(4.0, 5.0, 6.0)).alignment.frame
    assert frame is not None
    here = frame.position(np.array([10.0, 20.0, -3.0]))
    assert here == pytest.approx([0.0, 111.2, 10.0], abs=0.1)
    assert meeting.fences == []


def test_a_vehicle_in_the_air_is_given_three_seconds_to_say_where_it_took_off(
    meeting: Meeting,
) -> None:
    """Then it is not flown."""
    meeting.telemetry.armed = True

    def told() -> None:
        meeting.telemetry.home = np.array([10.0, 20.0, 0.0])

    meeting.deeds[102.75] = told
    assert meeting.establish().alignment.frame is not None
    assert meeting.now == 102.75
    meeting.telemetry.home = None
    with pytest.raises(VehicleError, match="flying already, and does not say where it took off"):
        meeting.establish()
    assert meeting.now == 105.75


def test_who_loses_its_place_before_its_frame_lies_is_not_met(meeting: Meeting) -> None:
    """In the seconds in which it is asked where it took off."""
    meeting.telemetry.armed = True

    def lost() -> None:
        meeting.telemetry.place, meeting.telemetry.home = None, np.array([10.0, 20.0, 0.0])

    meeting.deeds[101.0] = lost
    with pytest.raises(VehicleError, match="lost its position while being connected"):
        meeting.establish()


def test_who_loses_its_place_once_its_frame_lies_is_met(meeting: Meeting) -> None:
    """Where zero lies is known by then, whatever is seen to afterwards."""
    origin = meeting.establish().alignment.origin
    meeting.telemetry.software = ""

    def lost() -> None:
        meeting.telemetry.place, meeting.telemetry.software = None, "4.7.0"

    meeting.deeds[meeting.now + 0.5] = lost
    assert meeting.establish().alignment.origin == origin
    assert meeting.telemetry.place is None


def lose(meeting: Meeting, what: str) -> None:
    """Have it not know something."""
    if what == "place":
        meeting.telemetry.place = None
    if what == "heartbeat":
        meeting.telemetry.beat_at = -np.inf
    if what == "position":
        meeting.speaks = False
        meeting.telemetry.position_at = -np.inf


@pytest.mark.parametrize("what", ["place", "heartbeat", "position"])
def test_who_does_not_know_its_place_is_waited_for(
    monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    """Local, on the globe, and whether it is armed: as long as the settings say, then said."""
    meeting = Meeting(monkeypatch, ready_timeout=10.0)
    lose(meeting, what)
    words = "d: ArduPilot has not told its position within 10 s$"
    with pytest.raises(VehicleError, match=words):
        meeting.establish()
    assert meeting.now == 110.25

    def found() -> None:
        meeting.telemetry.place, meeting.telemetry.beat_at = (47.001, 8.0), meeting.now
        meeting.speaks = True
        meeting._speak()

    meeting.deeds[115.0] = found
    lose(meeting, what)
    meeting.establish()
    assert meeting.now == 115.0


def test_the_checks_are_asked_for_while_it_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each four seconds; what it says about them, of the last 40 s, is why it is not ready."""
    meeting = Meeting(monkeypatch, ready_timeout=50.0)
    meeting.telemetry.place = None
    texts = meeting.telemetry.texts
    meeting.deeds[105.0] = lambda: texts.add("PreArm: too old", 3, 105.0)
    meeting.deeds[115.0] = lambda: texts.add("PreArm: no GPS", 3, 115.0)
    meeting.deeds[149.0] = lambda: texts.add("PreArm: compass", 3, 149.0)
    with pytest.raises(VehicleError, match=r"50 s; it says: PreArm: no GPS; PreArm: compass$"):
        meeting.establish()
    times = meeting.orders(CHECKING)
    assert times[0] == 100.0 + CHECKS + 0.25
    assert set(np.diff(times)) == {CHECKS + 0.25}
    assert len(times) == 11


def test_events_tell_why_where_there_is_no_text(monkeypatch: pytest.MonkeyPatch) -> None:
    """PX4 says it in those."""
    meeting = Meeting(monkeypatch, ready_timeout=1.0)
    meeting.autopilot = PX4()
    meeting.telemetry.place = None
    meeting.telemetry.events.objections = ("compass: missing", "GPS: no fix")
    with pytest.raises(
        VehicleError, match=r"PX4 has .* 1 s; it says: compass: missing; GPS: no fix"
    ):
        meeting.establish()


def test_who_knows_its_place_and_would_not_arm_is_met_in_the_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Sooner if its checks pass; a take-off will be told why they do not."""
    meeting = Meeting(monkeypatch, ready_timeout=10.0)
    meeting.telemetry.sensors = Sensors(CHECK, CHECK, 0)
    meeting.establish()
    assert meeting.now == 110.25

    def well() -> None:
        meeting.telemetry.sensors = Sensors(CHECK, CHECK, CHECK)

    meeting.deeds[113.0] = well
    meeting.establish()
    assert meeting.now == 113.0


@pytest.mark.parametrize("failsafes", ["report", "set", "ignore"])
def test_what_leaves_it_unprotected_is_said_or_set(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, failsafes: str
) -> None:
    """As the settings say."""
    meeting = Meeting(monkeypatch, failsafes=failsafes)
    failsafe = SimpleNamespace(name="FS_EKF_ACTION", safe=1.0)
    meeting.unsafe = [SimpleNamespace(failsafe=failsafe, text="it is 0")]
    meeting.establish()
    assert meeting.set == ([("FS_EKF_ACTION", 1.0)] if failsafes == "set" else [])
    expected = {
        "report": ['d: it is 0 ("failsafes": "set" does it)'],
        "set": ["d: it is 0: set"],
        "ignore": [],
    }[failsafes]
    assert caplog.messages == expected
    if failsafes != "ignore":
        assert meeting.asked[0][1:] == (meeting.autopilot,)


def test_its_fence_is_uploaded_where_zero_lies(monkeypatch: pytest.MonkeyPatch) -> None:
    """5 m south of a vehicle whose start is 5 m north; with the action of the settings."""
    meeting = Meeting(monkeypatch, fence="land")
    limits = {"geofence": {"ceiling": 33.0}}
    meeting.establish(start=(0.0, 5.0, 0.0), limits=limits)
    ((link, autopilot, fence, origin, action),) = meeting.fences
    assert (link, autopilot, action) == (meeting.link, meeting.autopilot, "land")
    assert fence.ceiling == 33.0
    assert origin.latitude == pytest.approx(47.001 - 5.0 / 111_180, abs=1e-7)
    assert origin.longitude == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("start", "warned"),
    [
        ((0.0, 111.2, 0.0), False),
        ((19.9, 111.2, 0.0), False),
        ((20.1, 111.2, 0.0), True),
        ((0.0, 91.4, 0.0), False),
        ((0.0, 91.0, 0.0), True),
        ((-14.2, 125.4, 0.0), True),
        ((0.0, 111.2, 99.0), False),
    ],
)
def test_a_start_far_from_where_it_stands_is_warned_of(
    meeting: Meeting,
    caplog: pytest.LogCaptureFixture,
    start: tuple[float, float, float],
    *,
    warned: bool,
) -> None:
    """20 m along the ground by the globe; not one in the air, which has flown away from there."""
    meeting.settings = MavlinkSettings(failsafes="ignore", fallback="ignore")
    meeting.establish(HOME, start=start)
    assert any("d stands 20 m from where" in text for text in caplog.messages) is warned
    caplog.clear()
    meeting.telemetry.armed, meeting.telemetry.home = True, np.array([10.0, 20.0, -3.0])
    meeting.establish(HOME, start=start)
    assert caplog.messages == []

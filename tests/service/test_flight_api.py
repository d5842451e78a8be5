"""The API of a flight's process for its service, and cameras that are shared by it."""

from __future__ import annotations

import contextlib
import stat
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from flight_orders import order_in
from served_flight import Drones, ServedFlight
from waiting import until

from aerodaas.analytics.wire_items import pack
from aerodaas.clock import host_time_ns
from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import ConfigError, MissionError, SourceError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.health import HealthItem, HealthReport, Verdict
from aerodaas.messages.mission import MissionState, MissionStatus, RobotStatus
from aerodaas.mission.commands import Answer, TakeControls
from aerodaas.protocol.piloting import ControlsIn
from aerodaas.protocol.schemas import CommandIn, FlightLeaseIn, PictureForm
from aerodaas.service.flights import link, server
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.link import FlightLink
from aerodaas.service.flights.orders import HostFlight
from aerodaas.service.flights.server import LeasedFlight, LeaseWatch, ProcessServer
from aerodaas.service.flights.shared_camera import SharedCamera, attached_config
from aerodaas.service.http.limits import LEASED_FLIGHT
from aerodaas.service.own import flight as own

FLEET = {
    "name": "campus",
    "robots": [
        {
            "id": "one",
            "driver": "mavlink",
            "settings": {"url": "udpin:10.0.0.7:14540"},
            "sensors": [
                {"id": name, "type": "camera", "settings": {"path": f"rtsp://10.0.0.9/{name}"}}
                for name in ("cam", "belly")
            ],
        },
        {"id": "two"},
    ],
}

WINDY = HealthItem("wind", "12.0 m/s", "at most 10", Verdict.REFUSED, "wait for less wind")


class Pictures:
    """Reader of a camera whose pictures are counted by their value."""

    def __init__(self) -> None:
        self.packed = 0

    def next_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:
        """As the newest."""
        return self.latest_packed(timeout)

    def latest_packed(self, timeout: float) -> tuple[dict[str, Any], bytes] | None:  # noqa: ARG002
        """Pack a picture whose value counts."""
        self.packed += 1
        image = np.full((8, 16, 3), self.packed, np.uint8)
        item, blob = pack(
            Frame(Header(self.packed, 0, "one/cam"), image, None, None), lossless=True
        )
        return {"item": item, "captured": host_time_ns(), "blob": True}, blob


class Filming(LeasedFlight):
    """A flight with one camera."""

    pictures: Pictures
    form: PictureForm | None = None

    def reader(self, stream: str, form: PictureForm = PictureForm.WHOLE) -> Any:  # noqa: ANN401
        """The camera, of those that run."""
        self.form = form
        if stream != "one/cam":
            raise ConfigError(f"no stream of this mission is called {stream!r}")
        return self.pictures


class Flight:
    """A flight with a camera, and the service's link to its process."""

    def __init__(self, path: Path) -> None:
        self.folder = FlightFolder(path)
        self.lease = LeaseWatch(order_in(path), lambda _: None)
        self.drones = Drones(EnvironmentConfig.model_validate(FLEET))
        self.served = ServedFlight(self.folder, self.drones, self.lease, Filming)
        self.flight = cast("Filming", self.served.flight)
        self.pictures = self.flight.pictures = Pictures()
        self.link = FlightLink(self.folder)

    def end(self) -> Answer:
        """End the lease as the service does."""
        return self.link.change_lease(FlightLeaseIn(reason="revoked"))

    def close(self) -> None:
        """End."""
        self.link.close()
        self.served.close()

    def camera(self, mission: str, stream: str = "one/cam") -> SharedCamera:
        """The camera of an attached mission, from its environment."""
        to = HostFlight(mission="m", socket=self.folder.socket, sensors=[stream])
        config = attached_config(EnvironmentConfig.model_validate(FLEET), to, mission)
        (sensor,) = config.all_sensors()
        return SharedCamera(sensor, config)


@pytest.fixture
def flight() -> Iterator[Flight]:
    """A flight that shares its camera with the mission `crowd`."""
    with tempfile.TemporaryDirectory(prefix="share-", dir="/tmp") as folder:
        made = Flight(Path(folder))
        made.link.share("crowd", ["one/cam"])
        yield made
        made.close()


@pytest.mark.parametrize("form", list(PictureForm))
def test_a_live_views_pictures_are_made_in_the_form_that_it_asks_for(
    flight: Flight, form: PictureForm
) -> None:
    """By the flight's process, which has the pixels."""
    message, blob = next(found for found in flight.link.items("one/cam", form) if found[0])
    assert message["item"]["is"] == "Frame"
    assert blob
    assert flight.flight.form is form


def test_the_list_before_take_off_goes_to_the_service(flight: Flight) -> None:
    """Whole, with its age."""
    told = HealthReport((WINDY,), 3.0)
    status = MissionStatus(0, MissionState.IDLE)
    flight.flight.meter.status = {"one": RobotStatus(status, health=told)}
    assert flight.link.preflight("one") == told


def test_each_picture_is_the_newest_and_made_when_it_is_asked_for(flight: Flight) -> None:
    """A reader that stands still costs the flight nothing."""
    camera = flight.camera("crowd")
    camera.open()
    first, second = camera.capture(10**10, None), camera.capture(10**10, None)
    assert first is not None
    assert second is not None
    assert (first.image[0, 0, 0], second.image[0, 0, 0]) == (1, 2)
    assert 0 <= 10**10 - second.stamp < 10**9
    time.sleep(0.3)
    assert flight.pictures.packed == 2
    camera.close()


def test_what_is_withdrawn_ends_with_the_next_picture(flight: Flight) -> None:
    """The flight itself sends no more, and opens no more."""
    camera = flight.camera("crowd")
    camera.open()
    assert camera.capture(0, None) is not None
    assert flight.link.withdraw("crowd").accepted
    assert camera.capture(0, None) is None
    assert camera.finished
    with pytest.raises(SourceError, match="one/cam is not shared with crowd"):
        flight.camera("crowd").open()


@pytest.mark.parametrize(
    ("mission", "stream", "told"),
    [
        ("stranger", "one/cam", "one/cam is not shared with stranger"),
        ("crowd", "one/belly", "one/belly is not shared with crowd"),
    ],
)
def test_what_is_not_shared_is_refused_by_the_flight(
    flight: Flight, mission: str, stream: str, told: str
) -> None:
    """Whatever an attached mission's process asks for."""
    with pytest.raises(SourceError, match=told):
        flight.camera(mission, stream).open()
    assert flight.pictures.packed == 0


def test_an_operators_word_waits_for_no_users(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of whose commands the flight answers one after the other, or none while its drone hangs."""
    begun, free = threading.Event(), threading.Event()

    def hang(robot: str, command: object) -> Answer:
        del robot, command
        begun.set()
        assert free.wait(20)
        return Answer(accepted=False, text="late")

    flight.drones.obey = hang
    monkeypatch.setattr(own, "_PATIENCE", 60.0)
    pause = CommandIn(robot="one", command="pause")
    with ThreadPoolExecutor(40) as pool:
        asked = [pool.submit(flight.link.fly, pause, operator=False) for _ in range(40)]
        assert begun.wait(20)
        assert flight.end().accepted
        assert sum(one.done() for one in asked) <= 40 - link._MOST_ASKED
        until(lambda: sum(one.done() for one in asked) == 40 - link._MOST_ASKED)
        free.set()
    refused = [one for one in asked if one.exception()]
    assert len(refused) == 40 - link._MOST_ASKED
    assert "8 commands to answer" in str(refused[0].exception())


def test_nobody_waits_for_a_flight_to_note_that_its_user_is_there(
    flight: Flight, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may hang: its user still sees it, and an operator's word goes past."""
    begun, free, heard = threading.Event(), threading.Event(), threading.Semaphore(0)

    def hang() -> None:
        begun.set()
        assert free.wait(20)
        heard.release()

    monkeypatch.setattr(flight.lease, "record_presence", hang)
    monkeypatch.setattr(link, "_HEARD_SECONDS", 0.01)
    flight.link.record_presence()
    assert begun.wait(20)
    flight.link.record_presence()
    assert flight.end().accepted
    assert not heard.acquire(blocking=False)
    free.set()
    # Whoever was heard of meanwhile is told of, too, and later ones are.
    assert heard.acquire(timeout=20)
    assert heard.acquire(timeout=20)
    assert not heard.acquire(timeout=0.2)
    flight.link.record_presence()
    assert heard.acquire(timeout=20)


class Still(Pictures):
    """A camera without pictures."""

    def next_packed(self, timeout: float) -> None:
        """None."""
        time.sleep(timeout / 20)


def test_who_watches_much_keeps_nobody_from_commanding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many views as the flight has places leave some to the service itself."""
    monkeypatch.setattr(server, "LEASED_FLIGHT", replace(LEASED_FLIGHT, account_views=5))
    flight = Flight(tmp_path)
    flight.flight.pictures = Still()
    views = [flight.link.items("one/cam") for _ in range(8)]
    assert sum(_shows(view) for view in views) == 5
    with pytest.raises(SourceError, match="5 live views"):
        flight.camera("crowd").open()
    late = FlightLink(flight.folder)
    assert late.change_lease(FlightLeaseIn(ends=time.time() + 60)).accepted
    until(lambda: late.number)
    late.close()
    # Each is closed with its generator.
    views.clear()
    until(lambda: _shows(flight.link.items("one/cam")))
    flight.close()


def _shows(view: Any) -> bool:  # noqa: ANN401 - a generator
    with contextlib.suppress(MissionError):
        next(view)
        return True
    return False


def test_a_camera_ends_with_its_flight(flight: Flight) -> None:
    """However that ends."""
    camera = flight.camera("crowd")
    camera.open()
    flight.flight.end()
    assert camera.capture(0, None) is None
    assert camera.finished
    late = flight.camera("crowd")
    flight.close()
    with pytest.raises(SourceError, match="its flight does not answer"):
        late.open()


def test_nothing_is_shared_once_the_drones_come_home(flight: Flight) -> None:
    """The owner's agreement ends with the lease; withdrawing goes on working."""
    flight.lease.end("the lease has ended")
    answer = flight.link.share("late", ["one/cam"])
    assert (answer.accepted, answer.text) == (False, "the drones come home: the lease has ended")
    with pytest.raises(SourceError, match="not shared with late"):
        flight.camera("late").open()
    assert flight.link.withdraw("crowd").accepted


def test_an_attached_environment_has_cameras_and_nothing_that_flies() -> None:
    """No address, driver or setting of a vehicle; no camera that is not shared."""
    to = HostFlight(mission="m", socket=Path("api"), sensors=["one/cam"])
    config = attached_config(EnvironmentConfig.model_validate(FLEET), to, "crowd")
    assert [robot.id for robot in config.robots] == ["one"]
    assert [one.full_id for one in config.all_sensors()] == ["one/cam"]
    text = config.model_dump_json()
    assert "10.0.0" not in text
    assert "mavlink" not in text


def test_readers_do_not_wait_for_each_other(flight: Flight) -> None:
    """One that has asked and does not take its picture holds up nobody."""
    flight.link.share("slow", ["one/cam"])
    slow, quick = flight.camera("slow"), flight.camera("crowd")
    slow.open()
    quick.open()
    assert slow._connection is not None
    slow._connection.send("")
    done = threading.Event()

    def read() -> None:
        for _ in range(20):
            assert quick.capture(0, None) is not None
        done.set()

    threading.Thread(target=read, daemon=True).start()
    assert done.wait(10.0)


def test_a_state_that_cannot_be_read_is_told_of(
    flight: Flight, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once: a page would show the flight as it was, without a word."""
    monkeypatch.setattr(flight.flight, "text", lambda _: ('{"id": "of another version"}', False))
    until(lambda: caplog.records)
    monkeypatch.undo()
    number = flight.link.number
    until(lambda: flight.link.number >= number + 2)
    (record,) = caplog.records
    assert "its state cannot be read" in record.getMessage()


def test_a_flight_is_the_services_alone(flight: Flight) -> None:
    """Nobody else may open its socket; a path that is too long is told of before take-off."""
    assert stat.S_IMODE(flight.folder.socket.stat().st_mode) == 0o600
    long = flight.folder.path / ("x" * 120)
    with pytest.raises(MissionError, match="too long"):
        ProcessServer(long, flight.flight, flight.lease, flight.served.relay)


def test_an_operators_drone_obeys_also_once_the_lease_is_over(flight: Flight) -> None:
    """A pilot's comes home, whatever the pilot asks for."""
    land = CommandIn(robot="one", command="land")
    assert flight.link.fly(land, operator=False).accepted
    assert flight.end().accepted
    refused = flight.link.fly(land, operator=False)
    assert (refused.accepted, refused.text) == (False, "the drones come home: revoked")
    assert flight.link.fly(land, operator=True).accepted
    later = FlightLeaseIn(ends=time.time() + 60)
    assert flight.link.change_lease(later) == Answer(accepted=False, text="revoked")


def test_a_command_that_is_refused_is_answered(flight: Flight) -> None:
    """By the flight's reason; of a drone that does not answer it is told."""

    def refuse(robot: str, _: object) -> Answer:
        raise MissionError(f"{robot} does not fly in this mission")

    flight.drones.obey = refuse
    given = ControlsIn(robot="two", command=TakeControls("olga", 1))
    answer = flight.link.fly(given, operator=True)
    assert (answer.accepted, answer.text) == (False, "two does not fly in this mission")


def test_what_fails_in_the_flight_is_told_of(
    flight: Flight, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mistake there is not taken for somebody who has gone."""

    def fail(_: float) -> None:
        raise KeyError("missing")

    camera = flight.camera("crowd")
    camera.open()
    monkeypatch.setattr(flight.pictures, "latest_packed", fail)
    assert camera.capture(0, None) is None
    assert camera.finished
    until(lambda: "KeyError: 'missing'" in caplog.text)

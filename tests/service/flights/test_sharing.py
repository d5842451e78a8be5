"""Cameras shared by a flight's control socket: as long as it allows, and at the reader's pace."""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodaas.analytics.here.relay import HereRelay
from aerodaas.analytics.wire_items import pack
from aerodaas.clock import host_time_ns
from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import ConfigError, MissionError, SourceError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.health import HealthItem, Verdict
from aerodaas.protocol.preflight import PreflightOut
from aerodaas.protocol.schemas import PictureForm, StatusOut
from aerodaas.service.flights import link
from aerodaas.service.flights.control import ControlServer
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.link import FlightLink
from aerodaas.service.flights.order import Attached, FlightOrder
from aerodaas.service.flights.shared_camera import SharedCamera, attached_config
from aerodaas.service.flights.watch import LeaseWatch

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


class Flight:
    """A flight with a camera, behind its control socket."""

    def __init__(self, path: Path) -> None:
        self.folder = FlightFolder(path)
        order = FlightOrder(
            mission="m",
            lease="l",
            fleet=path,
            robots=["one"],
            locks=path,
            ends=time.time() + 60,
            minutes=1,
        )
        self.lease = LeaseWatch(order, lambda _: None)
        self.over = False
        self.form: PictureForm | None = None
        self.pictures = Pictures()
        self.commands: list[object] = []
        self.server = ControlServer(self.folder, self, self.lease, HereRelay(path / "here"))
        self.server.start()
        self.link = FlightLink(self.folder)

    def command(self, robot: str, command: object) -> Any:  # noqa: ANN401
        """Refuse, and note that it was asked."""
        self.commands.append((robot, command))
        raise MissionError("no command was to come")

    def status(self) -> tuple[dict[str, Any], list[str]]:
        """Nothing to tell."""
        return {}, []

    def analytics(self) -> None:
        """None."""

    def told(self) -> dict[str, float]:
        """Never."""
        return {}

    def preflight(self) -> dict[str, PreflightOut]:
        """A list that was gone through three seconds ago."""
        return {"one": PreflightOut.of("one", [WINDY], 3.0)}

    def streams(self) -> dict[str, Any]:
        """None."""
        return {}

    def reader(self, stream: str, form: PictureForm = PictureForm.WHOLE) -> Pictures:
        """The camera, of those that run."""
        self.form = form
        if stream != "one/cam":
            raise ConfigError(f"no stream of this mission is called {stream!r}")
        return self.pictures

    def close(self) -> None:
        """End."""
        self.link.close()
        self.server.close()

    def camera(self, mission: str, stream: str = "one/cam") -> SharedCamera:
        """The camera of an attached mission, from its environment."""
        to = Attached(mission="m", control=self.folder.socket, sensors=[stream])
        config = attached_config(EnvironmentConfig.model_validate(FLEET), to, mission)
        (sensor,) = config.all_sensors()
        return SharedCamera(sensor, config)


@pytest.fixture
def flight() -> Iterator[Flight]:
    """A flight that shares its camera with the mission `crowd`."""
    with tempfile.TemporaryDirectory(prefix="share-", dir="/tmp") as folder:
        made = Flight(Path(folder))
        made.link.ask(do="share", mission="crowd", streams=["one/cam"])
        yield made
        made.close()


@pytest.mark.parametrize("form", list(PictureForm))
def test_a_live_views_pictures_are_made_in_the_form_that_it_asks_for(
    flight: Flight, form: PictureForm
) -> None:
    """By the flight's process, which has the pixels."""
    message, blob = next(flight.link.items("one/cam", form))
    assert message["item"]["is"] == "Frame"
    assert blob
    assert flight.form is form


def test_the_list_before_take_off_goes_to_the_service(flight: Flight) -> None:
    """Whole, with its age."""
    until = time.monotonic() + 20.0
    while not flight.link.news.preflight:
        assert time.monotonic() < until
        time.sleep(0.02)
    assert flight.link.news.preflight == flight.preflight()


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
    assert flight.link.ask(do="withdraw", mission="crowd").accepted
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

    def hang(robot: str, command: object) -> Any:  # noqa: ANN401
        del robot, command
        begun.set()
        assert free.wait(20)
        raise MissionError("late")

    monkeypatch.setattr(flight, "command", hang)
    monkeypatch.setattr(link, "_ANSWER_SECONDS", 60.0)
    words = {"do": "pause", "robot": "one", "operator": False}
    with ThreadPoolExecutor(40) as pool:
        asked = [pool.submit(flight.link.ask, **words) for _ in range(40)]
        assert begun.wait(20)
        assert flight.link.ask(do="end", reason="revoked").accepted
        assert sum(one.done() for one in asked) <= 40 - link._MOST_ASKED
        until = time.monotonic() + 20
        while sum(one.done() for one in asked) < 40 - link._MOST_ASKED:
            assert time.monotonic() < until
            time.sleep(0.01)
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

    monkeypatch.setattr(flight.lease, "hear", hang)
    monkeypatch.setattr(link, "_ANSWER_SECONDS", 60.0)
    monkeypatch.setattr(link, "_HEARD_SECONDS", 0.01)
    flight.link.hear()
    assert begun.wait(20)
    flight.link.hear()
    assert flight.link.ask(do="end", reason="revoked").accepted
    assert not heard.acquire(blocking=False)
    free.set()
    # Whoever was heard of meanwhile is told of, too, and later ones are.
    assert heard.acquire(timeout=20)
    assert heard.acquire(timeout=20)
    assert not heard.acquire(timeout=0.2)
    flight.link.hear()
    assert heard.acquire(timeout=20)


class Still(Pictures):
    """A camera without pictures."""

    def next_packed(self, timeout: float) -> None:
        """None."""
        time.sleep(timeout / 20)


def test_who_watches_much_keeps_nobody_from_commanding(flight: Flight) -> None:
    """As many views as the control socket has places leave some to the service itself."""
    flight.pictures = Still()
    views = [flight.link.items("one/cam") for _ in range(64)]
    shown = [view for view in views if _shows(view)]
    assert 0 < len(shown) < len(views)
    late = FlightLink(flight.folder)
    assert late.ask(do="heard").accepted
    late.close()
    # Each is closed with its generator.
    views.clear()
    shown.clear()
    until = time.monotonic() + 20.0
    while not _shows(flight.link.items("one/cam")):
        assert time.monotonic() < until


def _shows(view: Any) -> bool:  # noqa: ANN401 - a generator
    with contextlib.suppress(MissionError):
        next(view)
        return True
    return False


def test_a_camera_ends_with_its_flight(flight: Flight) -> None:
    """However that ends."""
    camera = flight.camera("crowd")
    camera.open()
    flight.over = True
    assert camera.capture(0, None) is None
    assert camera.finished
    late = flight.camera("crowd")
    flight.close()
    with pytest.raises(SourceError, match="its flight does not answer"):
        late.open()


def test_nothing_is_shared_once_the_drones_come_home(flight: Flight) -> None:
    """The owner's agreement ends with the lease; withdrawing goes on working."""
    flight.lease.end("the lease has ended")
    answer = flight.link.ask(do="share", mission="late", streams=["one/cam"])
    assert (answer.accepted, answer.text) == (False, "the drones come home: the lease has ended")
    with pytest.raises(SourceError, match="not shared with late"):
        flight.camera("late").open()
    assert flight.link.ask(do="withdraw", mission="crowd").accepted


def test_an_attached_environment_has_cameras_and_nothing_that_flies() -> None:
    """No address, driver or setting of a vehicle; no camera that is not shared."""
    to = Attached(mission="m", control=Path("control"), sensors=["one/cam"])
    config = attached_config(EnvironmentConfig.model_validate(FLEET), to, "crowd")
    assert [robot.id for robot in config.robots] == ["one"]
    assert [one.full_id for one in config.all_sensors()] == ["one/cam"]
    text = config.model_dump_json()
    assert "10.0.0" not in text
    assert "mavlink" not in text


def test_readers_do_not_wait_for_each_other(flight: Flight) -> None:
    """One that has asked and does not take its picture holds up nobody."""
    flight.link.ask(do="share", mission="slow", streams=["one/cam"])
    slow, quick = flight.camera("slow"), flight.camera("crowd")
    slow.open()
    quick.open()
    assert slow._channel is not None
    slow._channel.send({})
    done = threading.Event()

    def read() -> None:
        for _ in range(20):
            assert quick.capture(0, None) is not None
        done.set()

    threading.Thread(target=read, daemon=True).start()
    assert done.wait(10.0)
    assert flight.commands == []


class Garbled(StatusOut):
    """A status of another version, which has other fields."""

    def model_dump(self, **_: Any) -> dict[str, Any]:  # noqa: ANN401 - the base's
        """Too few of them."""
        return {"time": 1.0}


def test_news_that_cannot_be_read_are_told_of(
    flight: Flight, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once: a page would show the flight as it was, without a word."""
    monkeypatch.setattr(flight, "status", lambda: ({"one": Garbled.model_construct()}, []))
    until = time.monotonic() + 20.0
    while not caplog.records:
        assert time.monotonic() < until
        time.sleep(0.01)
    monkeypatch.undo()
    number = flight.link.news.number
    while flight.link.news.number < number + 2:
        assert time.monotonic() < until
        time.sleep(0.01)
    (record,) = caplog.records
    assert "its news cannot be read" in record.getMessage()
    assert "StatusOut" in record.getMessage()


def test_what_fails_in_the_flight_is_told_of(
    flight: Flight, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A mistake there is not taken for somebody who has gone."""

    def fail(_: float) -> None:
        raise KeyError("missing")

    monkeypatch.setattr(flight.pictures, "next_packed", fail)
    with pytest.raises(MissionError, match="ended"):
        list(flight.link.items("one/cam"))
    until = time.monotonic() + 20.0
    while not caplog.records:
        assert time.monotonic() < until
        time.sleep(0.01)
    assert "control socket failed" in caplog.text
    assert "KeyError: 'missing'" in caplog.text

"""Following a mission and its streams over connections that are lost."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from provider_stub import MISSION, Stub, mission

from aerodaas.analytics.wire_items import pack
from aerodaas.environment.provider import exchange as module
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.environment.provider.follower import MissionFollower
from aerodaas.environment.provider.here import HereLink
from aerodaas.environment.provider.streams import WireReader
from aerodaas.errors import ConfigError, MissionError
from aerodaas.messages.frames import Frame, Header
from aerodaas.messages.odometry import Odometry
from aerodaas.messages.serialization.opaque_item import OpaqueItem
from aerodaas.messages.serialization.schema import MessageError
from aerodaas.protocol.schemas import MissionPhase

SECONDS = 20.0


@pytest.fixture(autouse=True)
def _short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_FIRST_PAUSE", 0.01)


def following(client: ProviderClient, said: list[str] | None = None) -> MissionFollower:
    """A follower that has begun."""
    follower = MissionFollower(client, client.mission(MISSION), (said or []).append)
    follower.start()
    return follower


def test_each_change_arrives_until_the_mission_is_over(client: ProviderClient, stub: Stub) -> None:
    """The last state is the one that it ended in."""
    follower = following(client)
    stub.state = mission(MissionPhase.FLYING, reason="on its way")
    seen, until = follower.mission, time.monotonic() + SECONDS
    while seen.reason != "on its way" and time.monotonic() < until:
        seen = follower.await_change(follower.changes, SECONDS)
    assert seen.reason == "on its way"
    stub.state = mission(MissionPhase.FAILED, reason="lost")
    assert follower.await_end(SECONDS)
    assert follower.mission == stub.state


def test_a_lost_connection_is_told_once_and_made_again(client: ProviderClient, stub: Stub) -> None:
    """The mission goes on meanwhile; its end is not missed."""
    said: list[str] = []
    stub.cuts = 3
    follower = MissionFollower(client, stub.state, said.append)
    follower.start()
    until = time.monotonic() + SECONDS
    while stub.cuts and time.monotonic() < until:
        time.sleep(0.01)
    stub.state = mission(MissionPhase.LANDED)
    assert follower.await_end(SECONDS)
    lost = [text for text in said if "lost" in text]
    back = [text for text in said if "back" in text]
    assert lost
    assert len(back) == len(lost) or len(back) == len(lost) - 1


def test_a_provider_that_is_gone_is_asked_until_it_is_back(
    client: ProviderClient, stub: Stub
) -> None:
    """It is told once that it is gone, however many attempts fail."""
    said: list[str] = []
    stub.refusals["/v1/missions"] = (503, {"text": "the database is gone"})
    follower = MissionFollower(client, stub.state, said.append)
    follower.start()
    until = time.monotonic() + SECONDS
    while stub.denied < 4 and time.monotonic() < until:
        time.sleep(0.01)
    assert stub.denied >= 4
    assert len(said) == 1
    assert "the database is gone" in said[0]
    stub.state = mission(MissionPhase.LANDED)
    stub.refusals.clear()
    assert follower.await_end(SECONDS)


def test_a_token_that_is_revoked_ends_the_watching(client: ProviderClient, stub: Stub) -> None:
    """Asking on would not help: whoever waits is told why."""
    stub.refusals["/v1/missions"] = (401, {"text": "the token is revoked"})
    follower = MissionFollower(client, stub.state)
    follower.start()
    with pytest.raises(ConfigError, match="the token is revoked"):
        follower.await_change(follower.changes, SECONDS)


def test_a_closed_follower_says_nothing(client: ProviderClient) -> None:
    """The mission goes on without it."""
    said: list[str] = []
    follower = MissionFollower(client, client.mission(MISSION), said.append)
    follower.start()
    follower.await_change(0, SECONDS)
    follower.close()
    follower._thread.join(SECONDS)
    assert not follower._thread.is_alive()
    assert said == []


def heads(*items: object) -> list[tuple[dict[str, object], bytes]]:
    """Messages of these items."""
    packed = [pack(item) for item in items]
    return [({"seq": n, "item": content}, blob) for n, (content, blob) in enumerate(packed)]


def test_items_of_a_stream_arrive_in_order(client: ProviderClient, stub: Stub) -> None:
    """As they were sent, pictures among them; the stream ends with the mission."""
    odometry = Odometry(np.array([1.0, 2.0, 3.0]), np.zeros(3), 0.5)
    frame = Frame(Header(1, 2, "cam"), np.full((36, 64, 3), 90, np.uint8))
    stub.items = heads(odometry, frame, "text")
    reader = WireReader(client, following(client), "drone/odom")
    assert reader.next(SECONDS) == odometry
    picture = reader.next(SECONDS)
    assert isinstance(picture, Frame)
    assert picture.header == frame.header
    assert picture.image.shape == (36, 64, 3)
    assert reader.next(SECONDS) == "text"
    assert reader.newest(SECONDS) == "text"
    assert reader.newest(0.0) == "text"
    with pytest.raises(TimeoutError):
        reader.next(0.01)
    stub.state = mission(MissionPhase.LANDED)
    with pytest.raises(StopIteration):
        reader.next(SECONDS)


def test_a_malformed_item_is_left_out(client: ProviderClient, stub: Stub) -> None:
    """The next one arrives; nothing of it is unpickled or run."""
    stub.items = [
        ({"seq": 0, "item": {"is": "os.system", "of": {"command": "true"}}}, b""),
        ({"seq": 1, "item": 5}, b"bytes beside a number"),
        *heads("well"),
    ]
    follower = following(client)
    with pytest.warns(UserWarning, match="left out"):
        assert WireReader(client, follower, "drone/odom").next(SECONDS) == "well"


def test_an_item_that_the_provider_cannot_send_is_told(client: ProviderClient, stub: Stub) -> None:
    """Of a plug-in's own class, say: the user of a stream of nothing else hears why it is still."""
    told = {
        "kind": "left_out",
        "seq": 0,
        "reason": "Strange is of no class that goes over the wire",
    }
    stub.items = [(told, b""), *heads("well")]
    follower = following(client)
    with pytest.warns(UserWarning, match="drone/odom: an item is left out: Strange is of no class"):
        assert WireReader(client, follower, "drone/odom").next(SECONDS) == "well"


def test_the_applications_own_items_are_its_own_again(client: ProviderClient, stub: Stub) -> None:
    """What stands for one on the wire is taken back; one that is not kept any more is told."""
    own = object()

    def revealed(item: object) -> object:
        if isinstance(item, OpaqueItem) and item.data == b"2":
            raise MessageError("an Own that is no longer kept here")
        return own if isinstance(item, OpaqueItem) else item

    stub.items = heads(OpaqueItem("Own", 1, b"2"), OpaqueItem("Own", 1, b"1"), "well")
    follower = following(client)
    with pytest.warns(UserWarning, match="left out: an Own that is no longer kept here"):
        found = WireReader(client, follower, "drone/own", revealed).next(SECONDS)
    assert found is own


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_reader_that_fails_has_not_ended(client: ProviderClient, stub: Stub) -> None:
    """A mistake is no end of the mission, after which a loop over a stream just goes on."""

    def revealed(_: object) -> object:
        raise KeyError("missing")

    stub.items = heads("well")
    reader = WireReader(client, following(client), "drone/odom", revealed)
    with pytest.raises(MissionError, match="drone/odom: KeyError: 'missing'"):
        reader.next(SECONDS)


def test_refusals_of_the_users_side_are_told(client: ProviderClient) -> None:
    """Once: its own connection needs more than that of who follows."""
    said: list[str] = []
    told = threading.Event()

    class Refusing:
        def here(self, _: str) -> object:
            raise ConfigError("the scope compute is missing")

    class Nobody:
        def close(self) -> None:
            """Nothing is open."""

    def say(text: str) -> None:
        said.append(text)
        told.set()

    arguments = Refusing(), following(client), Nobody()
    link = HereLink(*arguments, say)  # type: ignore[arg-type]
    assert told.wait(SECONDS)
    time.sleep(0.2)
    link.close()
    assert said == ["the analyses at this side are not asked: the scope compute is missing"]


def test_a_stream_is_read_on_after_a_lost_connection(client: ProviderClient, stub: Stub) -> None:
    """The reader waits meanwhile."""
    stub.items = heads("one")
    stub.cuts = 2
    reader = WireReader(client, following(client), "drone/odom")
    assert [reader.next(SECONDS), reader.next(SECONDS)] == ["one", "one"]


def test_a_refused_stream_is_told(client: ProviderClient, stub: Stub) -> None:
    """An account without the scope learns it from the service's words."""
    follower = following(client)
    stub.refusals["/v1/missions"] = (403, {"text": "the scope sense is missing"})
    reader = WireReader(client, follower, "drone/odom")
    with pytest.raises(ConfigError, match="the scope sense is missing"):
        reader.next(SECONDS)


def test_after_the_end_no_time_limit_is_told(client: ProviderClient, stub: Stub) -> None:
    """Also while the connection for the last items is not made: by which is left to chance."""
    follower = following(client)
    stub.state = mission(MissionPhase.LANDED)
    assert follower.await_end(SECONDS)
    stub.refusals["/v1/missions"] = (503, {"text": "the database is gone"})
    reader = WireReader(client, follower, "drone/odom")
    for read in (reader.next, reader.newest):
        with pytest.raises(StopIteration):
            read(0.02)


def test_many_readers_end_with_the_mission(client: ProviderClient, stub: Stub) -> None:
    """No thread is left waiting."""
    follower = following(client)
    readers = [WireReader(client, follower, f"drone/{one}") for one in range(5)]
    ended: list[int] = []

    def drain(number: int) -> None:
        with pytest.raises(StopIteration):
            readers[number].next(SECONDS)
        ended.append(number)

    threads = [threading.Thread(target=drain, args=(one,)) for one in range(5)]
    for one in threads:
        one.start()
    stub.state = mission(MissionPhase.LANDED)
    for one in threads:
        one.join(SECONDS)
    assert sorted(ended) == [0, 1, 2, 3, 4]

"""The client's exchanges: what a service refuses, says wrongly, or does not say at all."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from provider_stub import MISSION, TOKEN, Stub, mission

from aerodaas.environment.provider import exchange
from aerodaas.environment.provider.client import LARGEST_MODEL, ProviderClient
from aerodaas.errors import AeroDaaSError, ConfigError, MissionError, SourceError
from aerodaas.messages.waypoints import Waypoint
from aerodaas.protocol.schemas import CommandIn, MissionPhase, NavigationIn


@contextmanager
def answering(*answers: bytes) -> Iterator[tuple[str, list[bytes]]]:
    """A server that sends these bytes to one connection each and closes it; also what it got."""
    listener = socket.create_server(("127.0.0.1", 0))
    got: list[bytes] = []

    def serve() -> None:
        for answer in answers:
            try:
                connection, _ = listener.accept()
            except OSError:
                return
            with connection:
                got.append(connection.recv(1 << 16))
                connection.sendall(answer)

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}", got
    finally:
        listener.close()


def test_answers_are_models(client: ProviderClient, stub: Stub) -> None:
    """Each route's answer is its model; the token goes in the header, and nowhere else."""
    assert [robot.battery for robot in client.fleet().robots] == [0.75]
    assert client.missions() == [stub.state]
    assert client.mission(MISSION) == stub.state
    assert client.command(MISSION, CommandIn(robot="drone", command="pause")).accepted
    navigation = NavigationIn(robot="drone", waypoints=[Waypoint("a", 1.0, 2.0, 3.0)])
    assert client.add_navigation(MISSION, navigation).accepted
    assert all(TOKEN not in path for _, path, _ in stub.asked)


@pytest.mark.parametrize(
    ("status", "kind"),
    [
        (400, ConfigError),
        (401, ConfigError),
        (403, ConfigError),
        (404, ConfigError),
        (413, ConfigError),
        (422, ConfigError),
        (409, MissionError),
        (429, MissionError),
        (500, MissionError),
        (503, MissionError),
        (502, SourceError),
        (504, SourceError),
    ],
)
def test_a_refusal_is_an_error_with_the_services_text(
    client: ProviderClient, stub: Stub, status: int, kind: type[AeroDaaSError]
) -> None:
    """What asking again does not mend is a usage error; control characters do not get through."""
    stub.refusals["/v1/missions"] = (status, {"text": "no \x1b[31mdrones"})
    with pytest.raises(kind, match=r"no \?\[31mdrones"):
        client.mission(MISSION)
    assert len(stub.asked) == 1


def test_a_wrong_token_is_told_with_the_remedy(stub: Stub) -> None:
    """`aerodaas login` is named."""
    with pytest.raises(ConfigError, match=r"no valid token.*aerodaas login"):
        ProviderClient(stub.url, "wrong").fleet()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"<html>", "its answer is no JSON"),
        (b"[" * 100_000, "its answer is no JSON"),
        ({"id": 5}, "name: Field required"),
        ([], "valid dictionary"),
        (b"\xff\xfe", "its answer is no JSON"),
    ],
)
def test_an_answer_of_another_kind_is_told(
    client: ProviderClient,
    stub: Stub,
    content: Any,  # noqa: ANN401 - JSON
    said: str,
) -> None:
    """Whatever stands there, it is one message that names the address."""
    stub.refusals["/v1/fleet"] = (200, content)
    with pytest.raises(MissionError, match=said) as raised:
        client.fleet()
    assert stub.url in str(raised.value)


def test_an_answer_without_end_is_cut(
    client: ProviderClient, stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No more is read than the largest answer has; the client goes on working."""
    monkeypatch.setattr(exchange, "_MOST_BYTES", 10_000)
    stub.refusals["/v1/fleet"] = (200, b" " * 10_001)
    with pytest.raises(MissionError, match="larger than"):
        client.fleet()
    stub.refusals.clear()
    assert client.mission(MISSION) == stub.state


def test_a_service_that_does_not_answer_is_told(stub: Stub) -> None:
    """It is not waited for beyond the time limit; nor is one that is not there."""
    stub.slow = threading.Event()
    with pytest.raises(SourceError, match="does not answer"):
        ProviderClient(stub.url, TOKEN, timeout=0.2).fleet()
    free = socket.create_server(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    with pytest.raises(SourceError, match=rf"127\.0\.0\.1:{port} does not answer"):
        ProviderClient(f"http://127.0.0.1:{port}", TOKEN).fleet()


def test_what_may_have_been_done_is_not_asked_twice() -> None:
    """A cut connection repeats a question, and never a command."""
    with answering(b"", b"", b"") as (url, got):
        client = ProviderClient(url, TOKEN)
        with pytest.raises(SourceError):
            client.command(MISSION, CommandIn(robot="drone", command="land"))
        assert len(got) == 1
        with pytest.raises(SourceError):
            client.mission(MISSION)
        assert len(got) == 3


def test_a_redirection_is_not_followed() -> None:
    """The token goes to the address that was named, and to no other."""
    with answering(b"HTTP/1.1 200 OK\r\n\r\n{}") as (other, elsewhere):
        moved = f"HTTP/1.1 302 Found\r\nLocation: {other}/v1/fleet\r\nContent-Length: 0\r\n\r\n"
        with (
            answering(moved.encode()) as (url, _),
            pytest.raises(MissionError, match="status 302"),
        ):
            ProviderClient(url, TOKEN).fleet()
        assert elsewhere == []


def test_a_recording_arrives_whole_or_not_at_all(
    client: ProviderClient, stub: Stub, tmp_path: Path
) -> None:
    """The progress ends with all bytes; a broken download leaves no file and no part of one."""
    stub.recording = bytes(1_000_000)
    seen: list[tuple[int, int | None]] = []
    target = tmp_path / "new" / "flight.mcap"
    client.recording(MISSION, target, lambda *one: seen.append(one))
    assert target.read_bytes() == stub.recording
    assert seen[-1] == (1_000_000, 1_000_000)
    with (
        answering(b"HTTP/1.1 200 OK\r\nContent-Length: 100\r\n\r\nonly this") as (url, _),
        pytest.raises(SourceError, match="does not answer"),
    ):
        ProviderClient(url, TOKEN).recording(MISSION, tmp_path / "cut" / "flight.mcap")
    assert list((tmp_path / "cut").iterdir()) == []
    stub.refusals["/v1/missions"] = (404, {"text": "it has no recording yet"})
    with pytest.raises(ConfigError, match="no recording yet"):
        client.recording(MISSION, tmp_path / "none.mcap")
    assert not (tmp_path / "none.mcap").exists()


def test_models_go_by_their_hash(client: ProviderClient, stub: Stub) -> None:
    """One that is there need not be sent; one that is too large is not sent at all."""
    sha256 = client.put_model(b"a model")
    assert client.has_model(sha256)
    assert not client.has_model("0" * 64)
    sent = len(stub.asked)
    with pytest.raises(ConfigError, match="64 MiB"):
        client.put_model(bytes(LARGEST_MODEL + 1))
    assert len(stub.asked) == sent


def test_a_name_is_one_part_of_a_path(client: ProviderClient, stub: Stub) -> None:
    """Whatever a mission is called, no other route is asked."""
    stub.refusals["/v1/missions/"] = (404, {"text": "there is no such mission"})
    with pytest.raises(ConfigError, match="no such mission"):
        client.cancel("../accounts?x=1#")
    assert [method for method, _, _ in stub.asked] == ["DELETE"]


def test_live_connections_tell_the_mission_until_it_is_over(
    client: ProviderClient, stub: Stub
) -> None:
    """A refused one is told in the service's words, which its handshake's answer has."""
    stub.state = mission(MissionPhase.LANDED)
    with client.live(MISSION) as live:
        assert list(live) == [stub.state]
    stub.refusals["/v1/missions"] = (403, {"text": "another tenant's"})
    asked = len(stub.asked)
    with pytest.raises(ConfigError, match="another tenant's"):
        client.live(MISSION)
    assert len(stub.asked) == asked, "it needs no further question"

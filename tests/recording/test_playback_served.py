"""A recording's page is served to who has its token, and moments of the recording with it."""

from __future__ import annotations

import gzip
import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from played import served
from synthetic_flight import SyntheticFlight, record
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.errors import ConfigError, RecordingError
from aerodaas.protocol.playback import PlaybackOut
from aerodaas.protocol.schemas import MissionOut
from aerodaas.recording.reader import Recording
from aerodaas.service.live import playback
from aerodaas.service.live.playback import Player, Players

PLAYBACK = "/v1/missions/own/playback"
PICTURE = f"{PLAYBACK}/picture?stream=tello/camera&at="


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A survey with two pictures a second."""
    path = tmp_path_factory.mktemp("served") / "flight.mcap"
    record(path, SyntheticFlight(frames=2.0, hover=1.0))
    return path


@pytest.fixture(scope="module")
def page(path: Path) -> Iterator[str]:
    """One for all tests here, once it has been read."""
    with served(path) as address:
        wait(lambda: played(address).flight)
        yield address


def wait(true: Callable[[], object]) -> None:
    """Wait until something is so."""
    until = time.monotonic() + 30
    while not true():
        assert time.monotonic() < until
        time.sleep(0.02)


def ask(address: str, path: str, token: str | None = None, **headers: str) -> tuple[int, bytes]:
    """Send a request; returns status and answer."""
    base, _, own = address.partition("/#token=")
    given = {"Authorization": f"Bearer {own if token is None else token}", **headers}
    request = urllib.request.Request(base + path, headers=given)  # noqa: S310 - loopback
    try:
        with urllib.request.urlopen(request, timeout=20) as response:  # noqa: S310 - loopback
            return response.status, response.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


def played(address: str) -> PlaybackOut:
    """The flight, or how far it has been read."""
    status, content = ask(address, PLAYBACK)
    assert status == 200
    return PlaybackOut.model_validate_json(content)


def text(answer: tuple[int, bytes]) -> tuple[int, str]:
    """Status and text of a refusal."""
    return answer[0], json.loads(answer[1])["text"]


def moment(content: bytes) -> tuple[list[dict[str, Any]], bytes]:
    """The messages of a moment, and its picture."""
    head, _, data = content.partition(b"\n")
    return json.loads(head), data


def test_the_flight_is_told_and_its_pictures_are_shown(page: str) -> None:
    """Beside the routes that the page asks first."""
    (mission,) = json.loads(ask(page, "/v1/missions")[1])
    assert MissionOut.model_validate(mission).recording
    assert json.loads(ask(page, "/v1/me")[1])["role"] == "viewer"
    assert ask(page, "/v1/fleet")[0] == 200
    flight = played(page).flight
    assert flight is not None
    assert flight.name == "farm_survey"
    messages, data = moment(ask(page, f"{PICTURE}{10_200_000_000}")[1])
    assert [one["stream"] for one in messages] == ["tello/detector", "tello/camera"]
    stamp = messages[1]["captured"]
    assert 10_200_000_000 - 500_000_000 < stamp <= 10_200_000_000
    assert data.startswith(b"\xff\xd8")
    assert len(data) == messages[1]["item"]["bytes"][0]
    assert moment(ask(page, f"{PICTURE}0")[1]) == ([], b"")


@pytest.mark.parametrize(
    ("query", "status", "word"),
    [
        ("?stream=tello/other&at=1", 422, "tello/other"),
        ("?stream=tello/camera&at=-1", 422, "at"),
        ("?stream=tello/camera&at=1e3", 422, "at"),
        (f"?stream=tello/camera&at={2 * 10**18}", 422, "at"),
        (f"?stream={'x' * 5000}&at=1", 422, "stream"),
        ("?at=1", 422, "stream"),
    ],
)
def test_what_is_no_moment_is_refused(page: str, query: str, status: int, word: str) -> None:
    """With the reason."""
    found = text(ask(page, f"{PLAYBACK}/picture{query}"))
    assert found[0] == status
    assert word in found[1]


def test_nobody_else_sees_it(page: str) -> None:
    """Without the token, by a stranger's name or from a stranger's page; nor is there a command."""
    for token in ("", "wrong"):
        for path in (PLAYBACK, f"{PICTURE}1", "/v1/missions"):
            assert ask(page, path, token)[0] == 401
    assert ask(page, PLAYBACK, Host="evil.example")[0] == 403
    assert ask(page, PLAYBACK, Origin="https://evil.example")[0] == 403
    for path in (
        "/v1/missions/other/playback",
        "/v1/missions/other/playback/picture?stream=a&at=1",
    ):
        assert text(ask(page, path))[0] == 404
    assert ask(page, "/v1/missions/own/commands")[0] == 404
    assert ask(page, "/", "")[0] == 200


def test_a_flight_is_compressed_for_those_who_can_read_it(page: str) -> None:
    """A fraction of its bytes, and the same content; others get it as it is."""
    whole = ask(page, PLAYBACK)[1]
    packed = ask(page, PLAYBACK, **{"Accept-Encoding": "br, gzip"})[1]
    assert gzip.decompress(packed) == whole
    assert len(packed) < 0.3 * len(whole)


def test_two_are_served_side_by_side(path: Path, tmp_path: Path) -> None:
    """Each by a name of its own, with its own flight and pictures; there is no third."""
    longer = tmp_path / "longer.mcap"
    record(longer, SyntheticFlight(frames=2.0, hover=3.0))
    with served(path, longer) as shown:
        address, _, fragment = shown.partition("&")
        assert fragment == "mission=own&beside=own-2"
        status, said = ask(address, "/v1/missions")
        missions = [MissionOut.model_validate(one) for one in json.loads(said)]
        assert [one.id for one in missions] == ["own", "own-2"]
        flights = []
        for one in missions:
            way = f"/v1/missions/{one.id}/playback"
            wait(lambda way=way: json.loads(ask(address, way)[1])["flight"])  # type: ignore[misc]
            flights.append(PlaybackOut.model_validate_json(ask(address, way)[1]).flight)
            assert ask(address, f"{way}/picture?stream=tello/camera&at=40000000000")[0] == 200
        assert flights[0]
        assert flights[1]
        assert flights[1].end > flights[0].end + 5.0
        status, said = ask(address, "/v1/missions/own-3/playback")
        assert status == 404
        assert "there is own, own-2" in said.decode()


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--address", "nowhere"], "--address takes host:port"),
        (["--address", "127.0.0.1:99999"], "--address takes host:port"),
        (["--address", "192.0.2.1:0"], "give another --address"),
    ],
)
def test_the_command_says_what_is_wrong(path: Path, words: list[str], text: str) -> None:
    """Before anything is served; as for a file that is none."""
    found = CliRunner().invoke(app, ["view", str(path), *words])
    assert isinstance(found.exception, ConfigError)
    assert text in str(found.exception)
    missing = CliRunner().invoke(app, ["view", str(path.parent / "no.mcap")])
    assert isinstance(missing.exception, RecordingError)


def test_one_that_cannot_be_read_says_so(tmp_path: Path) -> None:
    """Without the folder that it lies in."""
    path = tmp_path / "empty.mcap"
    path.write_bytes(b"nothing of the kind")
    player = Player(path)
    with pytest.raises(RecordingError, match="is not an MCAP recording") as refused:
        wait(lambda: not player.text)
    assert str(tmp_path) not in str(refused.value)
    with pytest.raises(RecordingError, match="is not an MCAP"):
        player.picture("cam", 0)
    player.close()


def test_one_that_is_closed_is_read_no_further(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who goes from one to the next has a few read at once, and not all."""
    told = threading.Event()
    ended = threading.Event()

    def read(_: Recording, tell: Callable[[float], None]) -> None:
        until = time.monotonic() + 30
        try:
            while time.monotonic() < until:
                tell(0.5)
                told.set()
                time.sleep(0.01)
        finally:
            ended.set()

    monkeypatch.setattr(playback, "read_flight", read)
    player = Player(path)
    assert told.wait(20)
    player.close()
    assert ended.wait(10)


def test_as_many_are_open_as_a_provider_can_bear(path: Path) -> None:
    """The one that nobody looked at for longest is closed, and opened again for who comes back."""
    players = Players()
    first = players.of("m0", path)
    wait(lambda: PlaybackOut.model_validate_json(first.text).flight)
    assert first.picture("tello/camera", 10**10)
    for number in range(1, 4):
        players.of(f"m{number}", path)
    assert players.of("m0", path) is first
    players.of("m4", path)
    assert players.of("m0", path) is first
    for number in range(5, 9):
        players.of(f"m{number}", path)
    with pytest.raises(RecordingError, match="ask again"):
        first.picture("tello/camera", 10**10)
    assert players.of("m0", path) is not first
    for number in range(9, 13):
        players.of(f"m{number}", path)

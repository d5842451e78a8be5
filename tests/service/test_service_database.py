"""A served flight whose database goes away in mid-air, and comes back."""

from __future__ import annotations

import contextlib
import select
import shutil
import socket
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import pytest
from served import Served, document, fleet, robot

pytestmark = [pytest.mark.slow, pytest.mark.wall_clock]


class Outage(Protocol):
    """A database that a test takes away."""

    url: str

    def begin(self) -> None:
        """Take it away."""

    def end(self) -> None:
        """Give it back."""


class MovedFile:
    """SQLite's file, moved away as by somebody who tidies up."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self._folder = folder
        self.url = str(folder / "service.db")

    def begin(self) -> None:
        """Move its folder."""
        shutil.move(self._folder, f"{self._folder}-away")

    def end(self) -> None:
        """Move it back: the same file."""
        shutil.move(f"{self._folder}-away", self._folder)


class CutNetwork:
    """The way to a server, through a relay that is cut."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._server = (parts.hostname or "", parts.port or 5432)
        self._door = socket.create_server(("127.0.0.1", 0))
        user, _, _ = parts.netloc.rpartition("@")
        port = self._door.getsockname()[1]
        self.url = parts._replace(netloc=f"{user}@127.0.0.1:{port}").geturl()
        self._cut = threading.Event()
        threading.Thread(target=self._serve, daemon=True).start()

    def begin(self) -> None:
        """End all connections, and each new one at once."""
        self._cut.set()

    def end(self) -> None:
        """Take new ones again."""
        self._cut.clear()

    def close(self) -> None:
        """Listen no more."""
        self.begin()
        self._door.close()

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                client, _ = self._door.accept()
                threading.Thread(target=self._relay, args=(client,), daemon=True).start()

    def _relay(self, client: socket.socket) -> None:
        with client, contextlib.suppress(OSError):
            if self._cut.is_set():
                return
            with socket.create_connection(self._server) as server:
                other = {client: server, server: client}
                while not self._cut.is_set():
                    for ready in select.select(list(other), [], [], 0.05)[0]:
                        if not (data := ready.recv(65536)):
                            return
                        other[ready].sendall(data)


@pytest.fixture
def outage(place: str | Path, tmp_path: Path) -> Iterator[Outage]:
    """Of each database that is at hand."""
    if isinstance(place, Path):
        yield MovedFile(tmp_path / "database")
        return
    relay = CutNetwork(place)
    yield relay
    relay.close()


def test_a_flight_needs_no_database(outage: Outage) -> None:
    """It goes on without, and is commanded; its outcome is kept once the database is back.

    Nothing new is taken in meanwhile, and the log is not filled with that.
    """
    with Served(fleet(robot("one")), "--no-rehearse", "--database", outage.url) as provider:
        wanted = {"document": document("one", (6.0, 0.0))}
        flight = provider.ask("POST", "/v1/missions", wanted)["id"]
        path = f"/v1/missions/{flight}"

        def state_of_one() -> str:
            return str(provider.mission(flight)["status"]["one"]["mission"]["state"])

        def comes_to_be(state: str) -> None:
            provider.until(lambda: state_of_one() == state)

        provider.until_phase(flight, "flying")
        provider.until(lambda: "one" in provider.mission(flight)["status"])
        comes_to_be("enroute")
        outage.begin()
        for command, then in (("pause", "paused"), ("resume", "enroute")):
            answer = provider.ask("POST", f"{path}/commands", {"robot": "one", "command": command})
            assert answer["accepted"], answer
            comes_to_be(then)
        status, text = provider.ask("POST", "/v1/missions", wanted)
        assert status == 503
        assert "the service's database cannot be used" in text
        outage.end()
        ended = provider.until_phase(flight)
        assert ended["phase"] == "landed"
        assert ended["status"]["one"]["mission"]["visited"] == ["wp0"]
        assert provider.ask("GET", "/v1/usage")[0]["mission"] == flight
        said = provider.log.read_text()
    assert said.count("missions: ") <= 2
    assert "Traceback" not in said

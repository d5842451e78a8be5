"""HTTP clients: what they trust, what they log, and how much of an answer they read."""

from __future__ import annotations

import itertools
import logging
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer

import httpx
import pytest

from aerodaas.errors import ConfigError, SourceError
from aerodaas.http_client import http_client, http_errors, read_at_most


@pytest.fixture
def server() -> Iterator[str]:
    """A server that names what it was asked; `/moved` redirects."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            moved = self.path == "/moved"
            self.send_response(302 if moved else 200)
            if moved:
                self.send_header("Location", "/there")
            self.end_headers()
            self.wfile.write(f"{self.path} {self.headers['Accept-Encoding']}".encode())

        def log_message(self, format: str, *args: object) -> None:  # noqa: A002 - the base's
            del format, args

    served = HTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=served.serve_forever, args=(0.02,), daemon=True).start()
    yield f"http://127.0.0.1:{served.server_port}"
    served.shutdown()
    served.server_close()


def test_only_a_public_client_follows_redirects_and_proxies(
    server: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A request that carries a secret goes to the address that was named, and nowhere else."""
    with http_client(5.0) as client:
        assert client.get(f"{server}/moved").status_code == 302
    with http_client(5.0, public=True) as client:
        assert client.get(f"{server}/moved").text == "/there identity"
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    monkeypatch.delenv("no_proxy", raising=False)
    with http_client(5.0) as client:
        assert client.get(f"{server}/a").text == "/a identity"
    with http_client(5.0, public=True) as client, pytest.raises(httpx.ConnectError):
        client.get(f"{server}/a")
    monkeypatch.setenv("all_proxy", "gopher://127.0.0.1:1")
    with pytest.raises(ConfigError, match="proxy cannot be used"):
        http_client(5.0, public=True)


def test_no_address_is_logged(server: str, caplog: pytest.LogCaptureFixture) -> None:
    """Its parameters may hold a secret."""
    caplog.set_level(logging.DEBUG)
    with http_client(5.0) as client:
        assert client.get(f"{server}/a?code=hunter2").is_success
    assert "hunter2" not in caplog.text


def endless(_request: httpx.Request) -> httpx.Response:
    """An answer without end, 1 kB every millisecond."""

    def content() -> Iterator[bytes]:
        for _ in itertools.repeat(None):
            time.sleep(0.001)
            yield b"x" * 1000

    return httpx.Response(200, content=content())


def test_an_endless_answer_is_read_up_to_a_size_or_a_time() -> None:
    """To the byte; in time it is at most one chunk late."""
    with httpx.Client(transport=httpx.MockTransport(endless)) as client:
        with client.stream("GET", "http://a.example/") as response:
            assert read_at_most(response, 2500) == b"x" * 2500
        with (
            client.stream("GET", "http://a.example/") as response,
            pytest.raises(httpx.ReadTimeout),
        ):
            read_at_most(response, 1 << 40, time.monotonic() + 0.05)


def test_a_packed_answer_is_not_unpacked() -> None:
    """It could unpack to any size."""
    packed = httpx.MockTransport(
        lambda _: httpx.Response(
            200, headers={"Content-Encoding": "gzip"}, content=iter([b"packed"])
        )
    )
    with (
        httpx.Client(transport=packed) as client,
        client.stream("GET", "http://a.example/") as response,
    ):
        assert read_at_most(response, 100) == b"packed"


@pytest.mark.parametrize(
    "url", ["http://127.0.0.1:1/", "http://a..b/", "http://a:99999/", "gopher://a/", "http://[a/"]
)
def test_every_failure_of_a_request_takes_the_callers_form(url: str) -> None:
    """Also of hosts and ports that no network can have."""
    with http_client(5.0) as client, pytest.raises(SourceError), http_errors(SourceError):
        client.get(url)

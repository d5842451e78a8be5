"""A client of the WebSocket sees what the recorder writes."""

from __future__ import annotations

import json
import socket
import struct
from pathlib import Path
from typing import Any

import pytest
from synthetic_flight import FENCE, HOME, PROVENANCE, SyntheticFlight
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from aerodaas.config.model import RecordingConfig
from aerodaas.errors import ConfigError
from aerodaas.recording.live import LiveServer
from aerodaas.recording.recorder import FlightRecorder

pytestmark = pytest.mark.wall_clock


def watch(port: int, recorder: FlightRecorder, messages: list[Any]) -> dict[str, list[bytes]]:
    """Subscribe to every channel after the first half, and gather what comes by topic."""
    half = len(messages) // 2
    for message in messages[:half]:
        recorder.write(message)
    seen: dict[str, list[bytes]] = {}
    topics: dict[int, str] = {}
    waiting = messages[half:]
    with connect(
        f"ws://127.0.0.1:{port}", subprotocols=[Subprotocol("foxglove.sdk.v1")], max_size=None
    ) as socket:
        while True:
            try:
                data = socket.recv(timeout=0.05 if waiting and topics else 1.0)
            except TimeoutError:
                if not waiting:
                    return seen
                # In small bites: a burst may overrun what is kept for a client.
                for message in waiting[:20]:
                    recorder.write(message)
                waiting = waiting[20:]
                continue
            if isinstance(data, str):
                told = json.loads(data)
                if told["op"] == "advertise":
                    fresh = {one["id"]: one["topic"] for one in told["channels"]}
                    topics |= fresh
                    wanted = [{"id": key, "channelId": key} for key in fresh]
                    socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            elif data[0] == 1:
                (subscription,) = struct.unpack_from("<I", data, 1)
                seen.setdefault(topics[subscription], []).append(data[13:])


def test_a_late_client_sees_everything(tmp_path: Path) -> None:
    """The rest of the flight as it goes on, and at once what was said before it came."""
    messages = list(SyntheticFlight(frames=1, rate=1, hover=1).messages())
    with (
        LiveServer("127.0.0.1:0", "test") as live,
        FlightRecorder(
            tmp_path / "flight.mcap",
            config=RecordingConfig(),
            provenance=PROVENANCE,
            home=HOME,
            fences={"tello": FENCE},
            live=live,
        ) as recorder,
    ):
        seen = watch(live.port, recorder, messages)
    fence = json.loads(seen["/tello/fence"][-1])
    assert fence["polygon"] == [list(corner) for corner in FENCE.polygon]
    assert b"\xff\xd8\xff" in seen["/tello/camera/image"][-1]
    states = [json.loads(data)["stamp"] for data in seen["/tello/state"]]
    second_half = [m for m in messages[len(messages) // 2 :] if m.stream == "tello/@state"]
    assert states[-len(second_half) :] == [m.stamp for m in second_half]
    assert len(seen["/tello/camera/calibration"]) >= 1


@pytest.mark.parametrize("address", ["8765", "localhost", "127.0.0.1:x", "127.0.0.1:99999"])
def test_bad_addresses_are_refused(address: str) -> None:
    """In words, before anything flies."""
    with pytest.raises(ConfigError, match="live view"):
        LiveServer(address)


def test_a_port_in_use_is_refused() -> None:
    """With the remedy."""
    with LiveServer("127.0.0.1:0") as live, pytest.raises(ConfigError, match="--live-address"):
        LiveServer(f"127.0.0.1:{live.port}")


@pytest.mark.parametrize(
    ("host", "origin", "admitted"),
    [
        ("127.0.0.1", None, True),
        ("localhost", "http://localhost:3000", True),
        ("127.0.0.1", "https://app.foxglove.dev", True),
        ("127.0.0.1", "https://evil.example", False),
        ("127.0.0.1", "null", False),
        ("rebound.example", None, False),
        ("rebound.example", "http://rebound.example", False),
    ],
)
def test_a_strangers_page_does_not_watch(host: str, origin: str | None, admitted: bool) -> None:  # noqa: FBT001
    """By the origin that a browser tells, and by the name under which it came."""
    with LiveServer("127.0.0.1:0") as live:
        lines = ["GET / HTTP/1.1", f"Host: {host}", "Upgrade: websocket", "Connection: Upgrade"]
        lines += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", "Sec-WebSocket-Version: 13"]
        lines += ["Sec-WebSocket-Protocol: foxglove.sdk.v1"]
        lines += [] if origin is None else [f"Origin: {origin}"]
        with socket.create_connection(("127.0.0.1", live.port), timeout=5) as client:
            client.sendall("\r\n".join([*lines, "", ""]).encode())
            answer = client.recv(1000)
    assert answer.split()[1] == (b"101" if admitted else b"403")
    assert (b'{"text": "the live view answers to' in answer) != admitted

"""Relay between the nodes of a flight and its user's side: questions go there, answers come back.

It lives in the flight's process. Stand-ins (`HereAnalysis`) connect to its Unix socket, each with
one question at a time; the user's side is whatever connection the flight attaches to it. A message
on the socket is JSON and one blob, both of a bounded size.
"""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import struct
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.unix_server import UnixServer

__all__ = [
    "HEAD",
    "LARGEST_ANSWER",
    "LARGEST_TEXT",
    "Channel",
    "ChannelError",
    "HereRelay",
    "HereTimes",
    "HereUser",
    "Send",
    "attach_absent_user",
    "oversize",
]

LARGEST_TEXT = 4 << 20
"""Bytes of a message's JSON."""
_LARGEST_BLOB = 64 << 20
"""Bytes of a message's blob: a picture."""
HEAD = struct.Struct("<II")
"""Before each message: bytes of its JSON, and of its blob."""


class ChannelError(AeroDaaSError):
    """The other process has ended, is silent, or sent what is no valid message."""


class Channel:
    """One end of a connection."""

    def __init__(self, connection: socket.socket) -> None:
        """Exchange messages over `connection`."""
        self._socket = connection

    def send(self, text: dict[str, Any], blob: bytes = b"", timeout: float | None = None) -> None:
        """Send one message.

        Args:
            text: Its JSON, at most 4 MiB.
            blob: Bytes that follow it, at most 64 MiB.
            timeout: Seconds to wait until it is taken; None for no limit.

        Raises:
            ChannelError: If it is too large, not taken in time, or the other process has ended.
        """
        data = json.dumps(text).encode()
        if len(data) > LARGEST_TEXT or len(blob) > _LARGEST_BLOB:
            raise ChannelError(f"a message of {len(data)} and {len(blob)} bytes is too large")
        try:
            self._socket.settimeout(timeout)
            self._socket.sendall(HEAD.pack(len(data), len(blob)) + data + blob)
        except TimeoutError:
            raise ChannelError(f"took no message for {timeout:g} s") from None
        except OSError as error:
            raise ChannelError(f"its process has ended ({error.strerror})") from None

    def receive(self, timeout: float | None = None) -> tuple[dict[str, Any], bytes]:
        """Receive one message; raises ChannelError for none in time, and for a malformed one."""
        data, blob = self.receive_bytes(timeout)
        try:
            found = json.loads(data)
        except (ValueError, RecursionError):
            raise ChannelError("sent a message that is not JSON") from None
        if not isinstance(found, dict):
            raise ChannelError("sent a message that is no JSON object")
        return found, blob

    def receive_bytes(self, timeout: float | None = None) -> tuple[bytes, bytes]:
        """As `receive`, with the JSON as it came."""
        until = None if timeout is None else time.monotonic() + timeout
        text, blob = HEAD.unpack(self._read(HEAD.size, until))
        if text > LARGEST_TEXT or blob > _LARGEST_BLOB:
            raise ChannelError(
                f"sent a message of {text} and {blob} bytes; the most are {LARGEST_TEXT} and "
                f"{_LARGEST_BLOB}"
            )
        return self._read(text, until), self._read(blob, until)

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()

    def _read(self, size: int, until: float | None) -> bytes:
        data = bytearray()
        while len(data) < size:
            left = None if until is None else max(1e-3, until - time.monotonic())
            try:
                self._socket.settimeout(left)
                part = self._socket.recv(min(1 << 20, size - len(data)))
            except TimeoutError:
                part = b""
                if until is not None and time.monotonic() >= until:
                    raise ChannelError("did not answer in time") from None
                continue
            except OSError as error:
                raise ChannelError(f"its process has ended ({error.strerror})") from None
            if not part:
                raise ChannelError("its process has ended")
            data += part
            if until is not None and time.monotonic() > until and len(data) < size:
                raise ChannelError("did not answer in time")
        return bytes(data)


Send: TypeAlias = Callable[[dict[str, Any], bytes], None]
"""Sends one question, JSON and a blob, towards the user without waiting; raises if it cannot."""
LARGEST_ANSWER = 1 << 20
"""Bytes of an answer's JSON: a thousand waypoints or boxes take a quarter of it."""
_MOST_GROUPS = 20_000
"""Most lists and objects of an answer: a thousand boxes have a fifth; they take long to parse."""
_ANSWER_SECONDS = 3.0
"""Wall seconds for an answer, less than a node waits, and than a hung analysis may take."""
_PARTS = ("item", "fired", "alerts", "failed")
"""What an answer may hold, beside its `number` and the seconds that it `took`."""
_CONNECTIONS = 256
"""Most nodes' connections at once; a document has fewer analyses and conditions."""


@dataclass
class HereTimes:
    """Wall seconds that answers have taken, from the question at the relay to its answer there."""

    answers: int = 0
    missed: int = 0
    """Questions without an answer."""
    newest: float = 0.0
    longest: float = 0.0
    total: float = 0.0
    at_work: float = 0.0
    """Seconds of `total` that the user's code itself took, as the user's side says."""


@dataclass(eq=False)
class _Question:
    """A question on its way."""

    key: str
    user: HereUser
    asked: float = field(default_factory=time.monotonic)
    done: threading.Event = field(default_factory=threading.Event)
    answer: dict[str, Any] = field(default_factory=dict)


class HereUser:
    """One connection of the user's side, until it is detached or replaced by a newer one."""

    def __init__(self, relay: HereRelay, send: Send) -> None:
        """Connection by which `send` reaches the user."""
        self.send = send
        self.slow: dict[str, int] = {}
        """Questions whose time is over, by analysis: it is asked no more until it has answered."""
        self._relay = relay

    def answered(self, message: object, blob: bytes = b"") -> None:
        """Accept an answer as it came from the user; never raises.

        Args:
            message: Its JSON.
            blob: Bytes that came with it.
        """
        self._relay.accept_answer(self, message, blob)

    def answered_text(self, text: bytes, blob: bytes = b"") -> None:
        """As `answered`, with the JSON as it came; what cannot be an answer is not even parsed.

        Args:
            text: JSON of the answer as UTF-8.
            blob: Bytes that came with it.
        """
        if (
            not (self.slow or self._relay.waits)
            or text.count(b"[") + text.count(b"{") > _MOST_GROUPS
        ):
            return
        try:
            self.answered(json.loads(text), blob)
        except (ValueError, RecursionError):
            return

    def detach(self) -> None:
        """Tell the relay that this connection has ended."""
        self._relay.detach(self)


class HereRelay:
    """Relay between the nodes of one flight and the side of its user."""

    def __init__(self, path: Path, *, seconds: float = _ANSWER_SECONDS) -> None:
        """Relay at the socket `path`, which waits `seconds` for each answer."""
        self.path = path
        self._seconds = seconds
        self._lock = threading.Lock()
        self._attached = threading.Event()
        self._user: HereUser | None = None
        self._number = 0
        self._waiting: dict[int, _Question] = {}
        self._times: dict[str, HereTimes] = {}
        self._server: UnixServer | None = None

    def start(self) -> None:
        """Listen for nodes; raises ConfigError if there can be no socket at the path."""
        try:
            self._server = UnixServer(self.path, self._serve, name="here", most=_CONNECTIONS)
        except OSError as error:
            raise ConfigError(f"no socket at {self.path}: {error.strerror or error}") from None
        self._server.start()

    def attach(self, send: Send) -> HereUser:
        """Ask the user by `send` from now on; an earlier connection is asked no more.

        `send` is called by several threads, one at a time, with the question as JSON, which has a
        `number` that the answer repeats, and its blob. It must not wait: it fills a bounded queue,
        and raises if that is full.
        """
        user = HereUser(self, send)
        with self._lock:
            before, self._user = self._user, user
        if before is not None:
            self._drop(before, "the user's side has connected anew")
        self._attached.set()
        return user

    def wait_attached(self, timeout: float) -> bool:
        """Wait for the user's side to connect, `timeout` seconds at most; whether it has."""
        return self._attached.wait(timeout)

    @property
    def waits(self) -> bool:
        """Whether a question has no answer yet."""
        return bool(self._waiting)

    def detach(self, user: HereUser) -> None:
        """Ask `user` no more; what waits for it is told so."""
        with self._lock:
            if self._user is user:
                self._user = None
                self._attached.clear()
        self._drop(user, "the user's side has left")

    def accept_answer(self, user: HereUser, message: object, blob: bytes) -> None:
        """Accept an answer of the user; one to no question of theirs is ignored.

        Args:
            user: Who answers.
            message: JSON of the answer, with its `number`.
            blob: Bytes that came with it.
        """
        content = message if isinstance(message, dict) else {}
        number = content.get("number")
        if not isinstance(number, int):
            return
        answer = _checked(content, blob)
        with self._lock:
            user.slow = {key: late for key, late in user.slow.items() if late != number}
            question = self._waiting.get(number)
            if question is None or question.user is not user:
                return
            del self._waiting[number]
            self._measure(question, content.get("took"))
            question.answer = answer
        question.done.set()

    def times(self) -> dict[str, HereTimes]:
        """How long answers have taken, by the id of the analysis."""
        with self._lock:
            return {key: HereTimes(**vars(one)) for key, one in self._times.items()}

    def close(self) -> None:
        """Close the socket and all connections, and remove the path."""
        with self._lock:
            user, self._user = self._user, None
        if user is not None:
            self._drop(user, "the flight is over")
        if self._server is not None:
            self._server.close()
        self.path.unlink(missing_ok=True)

    def ask(self, request: dict[str, Any], blob: bytes) -> dict[str, Any]:
        """Ask the user.

        Args:
            request: Question as JSON, with the `key` of its analysis.
            blob: Bytes of the item that go beside the JSON.

        Returns:
            The answer, or why there is none, as `absent`.
        """
        key = str(request.get("key"))
        with self._lock:
            user = self._user
            if user is None:
                return self._missed(key, "the user's side is not connected")
            if key in user.slow:
                return self._missed(key, "the user's side still works at an earlier item")
            self._number += 1
            number = self._number
            question = self._waiting[number] = _Question(key, user)
            try:
                user.send({**request, "number": number}, blob)
            except Exception as error:  # noqa: BLE001 - a full queue, a connection that has ended
                del self._waiting[number]
                return self._missed(key, f"the user's side takes nothing: {error}"[:200])
        if question.done.wait(self._seconds):
            return question.answer
        with self._lock:
            if self._waiting.pop(number, None) is None:
                return question.answer
            user.slow[key] = number
            return self._missed(key, f"the user's side gave no answer in {self._seconds:g} s")

    def _serve(self, connection: socket.socket) -> None:
        channel = Channel(connection)
        with contextlib.suppress(ChannelError):
            while True:
                request, blob = channel.receive()
                channel.send(self.ask(request, blob))

    def _drop(self, user: HereUser, reason: str) -> None:
        with self._lock:
            mine = [number for number, one in self._waiting.items() if one.user is user]
            questions = [self._waiting.pop(number) for number in mine]
            for one in questions:
                one.answer = self._missed(one.key, reason)
        for one in questions:
            one.done.set()

    def _missed(self, key: str, reason: str) -> dict[str, Any]:
        self._times.setdefault(key, HereTimes()).missed += 1
        return {"absent": reason}

    def _measure(self, question: _Question, took: object) -> None:
        seconds = time.monotonic() - question.asked
        times = self._times.setdefault(question.key, HereTimes())
        times.answers += 1
        times.newest = seconds
        times.longest = max(times.longest, seconds)
        times.total += seconds
        if isinstance(took, int | float):
            times.at_work += min(max(0.0, took), seconds)


def oversize(content: dict[str, Any], blob: bytes) -> str:
    """Objection to an answer's size; empty if it fits.

    Args:
        content: JSON of the answer.
        blob: Bytes beside it, of which there may be none.
    """
    size = len(json.dumps(content))
    if blob or size > LARGEST_ANSWER:
        return f"an answer of {size} bytes and {len(blob)} beside it; the most are {LARGEST_ANSWER}"
    return ""


def _checked(content: dict[str, Any], blob: bytes) -> dict[str, Any]:
    try:
        wrong = oversize(content, blob)
    except (TypeError, ValueError, RecursionError) as error:
        wrong = f"an answer that is no JSON: {error}"[:200]
    return {"failed": wrong} if wrong else {key: content[key] for key in _PARTS if key in content}


def attach_absent_user(relay: HereRelay) -> None:
    """Answer the relay's questions with no result: code at the user's side is not rehearsed."""
    questions: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    user = relay.attach(lambda question, _: questions.put(question))

    def answer() -> None:
        while True:
            number = questions.get()["number"]
            user.answered({"number": number, "item": None, "fired": [], "alerts": []})

    threading.Thread(target=answer, name="absent user", daemon=True).start()

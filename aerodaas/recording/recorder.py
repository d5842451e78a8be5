"""Flight recorder: writes messages to an MCAP file that survives a crash.

Foxglove's SDK encodes the messages and the mcap library writes the file: the SDK's own writer
has no publish time and does not report a full disk.
"""

from __future__ import annotations

import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Any, TypeAlias

from foxglove import Schema
from foxglove.messages import LogLevel
from mcap.writer import Writer
from typing_extensions import Self

from aerodaas.clock import seconds
from aerodaas.config.model import GeofenceConfig, RecordingConfig
from aerodaas.errors import RecordingError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Frame
from aerodaas.recording.converters import Session, convert
from aerodaas.recording.converters.h264 import require_encoder
from aerodaas.recording.converters.mission import log_entry
from aerodaas.recording.converters.plan import fence_entries
from aerodaas.recording.encoding import Entry
from aerodaas.recording.live import LiveServer
from aerodaas.recording.messages import FORMAT, Drops, Latency, json_entry
from aerodaas.recording.output import Output, RecordingSummary
from aerodaas.recording.provenance import Provenance

__all__ = ["FLUSH_SECONDS", "FlightRecorder"]

FLUSH_SECONDS = 0.5
"""Most data that a killed process loses, in seconds of host time."""
_CHUNK = 1 << 20
_BATCH = 64
"""Most messages that gather before they are written; a frame ends a batch, too."""
_AHEAD = 4
"""Most batches that wait to be written; then `write` waits, too."""


class FlightRecorder:
    """Thread-safe recorder of messages to a new MCAP file.

    A message's log time is its mission time of publishing, its publish time that of the
    measurement, both counted from `provenance.started_ns`. Data written more than half a second
    ago survives a kill of this process and, soon after, a loss of power.

    A thread of its own encodes and writes, so that a second core compresses pictures. It gets
    messages in batches, because a change of threads for each would cost more than the writing.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        config: RecordingConfig,
        provenance: Provenance,
        home: GeodeticOrigin | None = None,
        fences: Mapping[str, GeofenceConfig] | None = None,
        live: LiveServer | None = None,
    ) -> None:
        """Create the file and start its flushing thread.

        Args:
            path: The new MCAP file; its folders are created.
            config: Image format and quality.
            provenance: Versions, configuration and application, written as metadata.
            home: Origin of the local reference frame, for maps; None for none.
            fences: Geofences by robot; None for none.
            live: Server that receives every entry, too; None for none.

        Raises:
            RecordingError: If the file exists or cannot be written, or if `config` requires
                H.264 and PyAV lacks the encoder.
        """
        if config.images == "h264":
            require_encoder()
        self.path = Path(path)
        self._session = Session(config, provenance.started_ns, home)
        """Used by the writing thread alone, once that has begun."""
        self._live = live
        self._output = Output(self.path)
        self._writer = Writer(self._output, chunk_size=_CHUNK)  # type: ignore[arg-type]
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._drops: Counter[str] = Counter()
        self._first: int | None = None
        self._last = 0
        self._failure = ""
        self._told = False
        self._summary: RecordingSummary | None = None
        self._lock = threading.Lock()
        """Held to write to the file, and to count."""
        self._batch: list[Message[Any]] = []
        self._most = 1 if live else _BATCH
        self._batching = threading.Lock()
        """Held to add to the batch, and to pass it on; taken before the other lock."""
        self._passed_on: deque[Future[None]] = deque()
        """Batches of which it is not known yet that they are written."""
        self._closing = threading.Event()
        try:
            self._begin(provenance, fences or {})
        except OSError as error:
            self._output.close()
            raise RecordingError(f"cannot write {self.path}: {error.strerror}") from None
        self._thread = _WritingThread(self._write_batch)
        self._flusher = threading.Thread(target=self._flush_regularly, daemon=True)
        self._flusher.start()

    def write(self, message: Message[Any]) -> None:
        """Record a message: its item, converted by type, and its latency per hop.

        The item must not change afterwards.

        Raises:
            RecordingError: Once, if recording had to stop (disk full), by this message or an
                earlier one; afterwards lost messages are only counted.
        """
        with self._batching:
            if self._failure or self._summary is not None:
                with self._lock:
                    self._lose(message.stream)
                return
            self._batch.append(message)
            if len(self._batch) >= self._most or isinstance(message.item, Frame):
                self._pass_on()

    def drops(self, stream: str, count: int = 1) -> None:
        """Count messages that were dropped before the recorder.

        Args:
            stream: Their stream.
            count: Their number.
        """
        self._settle()
        self._write_drops(stream, count)

    def flush(self) -> None:
        """Pass everything written so far to the operating system."""
        self._settle()
        with self._lock:
            if self._failure or self._summary is not None:
                return
            try:
                self._writer.flush()
            except OSError as error:
                self._fail(error)

    def close(self) -> RecordingSummary:
        """Finish the file and return its summary. May be called again; never raises."""
        self._closing.set()
        self._flusher.join()
        with self._batching:
            if self._summary is None:
                self._thread.submit(self._batch)
                self._thread.finish()
                with self._lock:
                    self._summary = self._finish()
            return self._summary

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _settle(self) -> None:
        """Wait until the thread has written what was recorded so far."""
        with self._batching:
            if self._summary is None:
                self._pass_on().result()

    def _pass_on(self) -> Future[None]:
        """Have the thread write the batch; the result is there once that is done.

        Raises what writing an earlier batch has raised, which is an error of this program.
        """
        if len(self._passed_on) >= _AHEAD:
            self._passed_on.popleft().result()
        batch, self._batch = self._batch, []
        self._passed_on.append(self._thread.submit(batch))
        return self._passed_on[-1]

    def _write_batch(self, batch: list[Message[Any]]) -> None:
        for message in batch:
            entries = self._entries(message)
            with self._lock:
                self._add(entries, message)

    def _write_drops(self, stream: str, count: int) -> None:
        with self._lock:
            self._drops[stream] += count
            entry = json_entry(Drops(stream, count, self._drops[stream]), "", self._last)
            if self._failure or self._summary is not None:
                return
            try:
                self._put(entry, self._last, self._last, self._counts["/drops"])
            except OSError as error:
                self._fail(error)

    def _entries(self, message: Message[Any]) -> list[Entry]:
        entries = []
        if message.item is not None:
            try:
                entries = list(convert(message.item, message, self._session))
            except Exception as error:  # noqa: BLE001 - an object of the application's may raise anything
                # An item that contradicts its own type must not end the flight or the recording.
                self._write_drops(message.stream, 1)
                text = f"cannot record a {type(message.item).__name__}: {error}"
                entries = [
                    log_entry(self._session, message.stamp, LogLevel.Error, message.stream, text)
                ]
        # A single span is recorded only for a message without an item (an analysis without
        # a result), which is recorded nowhere else.
        if len(message.spans) > (message.item is not None):
            entries.append(json_entry(Latency.of(message)))
        return entries

    def _begin(self, provenance: Provenance, fences: Mapping[str, GeofenceConfig]) -> None:
        self._writer.start(library=f"aerodaas {provenance.versions.get('aerodaas', '')}".strip())
        epoch = provenance.started_ns
        about = {"format": str(FORMAT), **provenance.as_metadata()}
        self._writer.add_metadata("aerodaas", about)
        for name, media_type, text in (
            ("environment.json", "application/json", provenance.config),
            ("mission.json", "application/json", provenance.document),
            (provenance.app or "app.py", "text/x-python", provenance.app_source),
        ):
            if text:
                self._writer.add_attachment(epoch, epoch, name, media_type, text.encode())
        for robot, fence in fences.items():
            for entry in fence_entries(fence, robot, self._session):
                self._put(entry, 0, 0, 0)
        self._writer.flush()

    def _add(self, entries: list[Entry], message: Message[Any]) -> None:
        if self._failure:
            self._drops[message.stream] += 1
            return
        if entries:
            self._first = message.stamp if self._first is None else self._first
            self._last = max(self._last, message.stamp)
        try:
            for entry in entries:
                captured = message.header.stamp if entry.stamp is None else entry.stamp
                self._put(entry, message.stamp, captured, message.seq)
        except OSError as error:
            self._fail(error)
            self._drops[message.stream] += 1

    def _put(self, entry: Entry, recorded: int, captured: int, sequence: int) -> None:
        channel = self._channels.get(entry.topic) or self._register(entry.topic, entry.schema)
        epoch = self._session.epoch_ns
        self._writer.add_message(
            channel,
            log_time=epoch + recorded,
            publish_time=epoch + captured,
            data=entry.data,
            sequence=sequence,
        )
        self._counts[entry.topic] += 1
        if self._live is not None:
            self._live.put(entry, epoch + recorded)

    def _register(self, topic: str, schema: Schema) -> int:
        name = schema.name
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, schema.encoding, schema.data)
        encoding = "json" if schema.encoding == "jsonschema" else schema.encoding
        self._channels[topic] = self._writer.register_channel(topic, encoding, self._schemas[name])
        return self._channels[topic]

    def _finish(self) -> RecordingSummary:
        if not self._failure:
            try:
                if self._drops:
                    figures = {stream: str(count) for stream, count in self._drops.items()}
                    self._writer.add_metadata("aerodaas.drops", figures)
                self._writer.finish()
                self._output.sync()
            except OSError as error:
                self._fail(error)
        with suppress(OSError):
            self._output.close()
        return RecordingSummary(
            path=self.path,
            channels=dict(self._counts),
            drops=dict(self._drops),
            duration=seconds(self._last - (self._first or 0)),
            size=self._output.tell(),
            stopped=self._failure,
        )

    def _fail(self, error: OSError) -> None:
        self._failure = (
            f"{self.path} could not be written any further ({error.strerror}); what it holds so "
            "far can be read; free space on the disk before the next flight"
        )

    def _lose(self, stream: str) -> None:
        self._drops[stream] += 1
        if self._failure and not self._told:
            self._told = True
            raise RecordingError(self._failure)

    def _flush_regularly(self) -> None:
        while not self._closing.wait(FLUSH_SECONDS):
            self.flush()
            try:
                # Not under the lock: a slow memory card must not delay `write`.
                self._output.sync()
            except OSError as error:
                with self._lock:
                    self._fail(error)
                return


_Batch: TypeAlias = "list[Message[Any]]"


class _WritingThread:
    """Thread that writes batches in order.

    It also works in exit handlers, which land the drones of an application that ends without
    waiting for them; the threads of `concurrent.futures` end before those.
    """

    def __init__(self, write: Callable[[_Batch], None]) -> None:
        self._write = write
        self._queue: SimpleQueue[tuple[_Batch, Future[None]] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def submit(self, batch: _Batch) -> Future[None]:
        """Have `batch` written; the result is there once that is done."""
        written: Future[None] = Future()
        self._queue.put((batch, written))
        return written

    def finish(self) -> None:
        """Wait until everything submitted is written, and end the thread."""
        self._queue.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (entry := self._queue.get()) is not None:
            batch, written = entry
            try:
                self._write(batch)
            except BaseException as error:  # noqa: BLE001 - raised again where the result is read
                written.set_exception(error)
            else:
                written.set_result(None)

"""Recorder actor: writes every stream of the run to an MCAP file."""

from __future__ import annotations

import itertools
from collections import Counter, deque
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodaas.actors.base import StreamActor
from aerodaas.actors.batch_pause import BatchPause
from aerodaas.actors.cluster.orphan_reaper import ReaperHost, Watched
from aerodaas.config.options import LiveViews
from aerodaas.recording.provenance import Provenance
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import vitals_stream
from aerodaas.types.clock import host_time_ns
from aerodaas.types.data import Header
from aerodaas.types.errors import RecordingError, failure_line
from aerodaas.types.geometry import GeodeticOrigin
from aerodaas.types.payload import Photo
from aerodaas.types.status import Message
from aerodaas.types.vitals import Vitals

if TYPE_CHECKING:
    from aerodaas.recording.ros.live import RosGraph

__all__ = ["RecorderActor"]

_LONGEST_PAUSE = 0.1
"""Wall seconds between two batches of messages."""


class RecorderActor(ReaperHost, StreamActor):
    """Actor that records `streams`; a full disk ends the recording, not the flight.

    As the last one of the run to end, it hosts the orphan reaper.
    """

    def __init__(
        self,
        session: Session,
        path: Path,
        streams: dict[str, int],
        provenance: Provenance,
        live: LiveViews | None,
        watched: Watched,
    ) -> None:
        """Create the actor, which writes to `path`; its reaper looks after the `watched`.

        `live` says who looks on.
        `streams` are queue depths by stream; further messages are dropped and counted, because
        the flight never waits.
        """
        StreamActor.__init__(self, session, "recorder", streams)
        ReaperHost.__init__(self, watched)
        self._path = path
        self._views = live or LiveViews()
        self._ros: RosGraph | None = None
        self._provenance = provenance
        self._failure = ""
        self._lost: Counter[str] = Counter()
        self._readings = 0
        # Who watches live sees each message as it comes.
        self._pause = BatchPause(0.0 if self._views != LiveViews() else _LONGEST_PAUSE)

    def _open(self) -> None:
        # The application's process imports this module, but does not need the writers.
        from aerodaas.recording.live import LiveServer  # noqa: PLC0415
        from aerodaas.recording.photo_album import PhotoAlbum, album_folder  # noqa: PLC0415
        from aerodaas.recording.recorder import FlightRecorder  # noqa: PLC0415

        environment = self.session.environment
        home = environment.home
        name = self._provenance.name
        address, domain = self._views.foxglove, self._views.ros2
        self._live = LiveServer(address, name) if address else None
        if domain is not None:
            from aerodaas.recording.ros.live import RosGraph  # noqa: PLC0415 - an extra

            quality = environment.recording.jpeg_quality
            self._ros = RosGraph(domain, self._provenance.started_ns, quality)
        # A restarted actor keeps its predecessor's file and writes a second part.
        self._path = _unwritten(self._path)
        self._album = PhotoAlbum(album_folder(self._path), environment)
        self._recorder = FlightRecorder(
            self._path,
            config=environment.recording,
            provenance=self._provenance,
            home=GeodeticOrigin(home.latitude, home.longitude, home.altitude) if home else None,
            fences={robot.id: robot.limits.geofence for robot in environment.robots},
            live=self._live,
        )

    def tell(
        self, kind: str, text: str, stamp: int, values: dict[str, Any], source: str = ""
    ) -> None:
        """Publish an alert and record it directly: the recorder does not read its own alerts."""
        super().tell(kind, text, stamp, values, source)
        if self._phase == "new":
            return
        with self._alerting:
            alert = self._newest_alerts[-1]
            stream, count = self.alerts.stream, self.alerts.sent
        self._write(Message(stream, count, stamp, alert.header, host_time_ns(), (), alert))

    def vitals(self, readings: dict[str, Vitals]) -> None:
        """Record the vitals of the run's processes, by `actor@machine`."""
        stamp = self.clock.now()
        self._readings += 1
        for source, reading in readings.items():
            stream = vitals_stream(source.partition("@")[0])
            header = Header(self._readings, stamp, source)
            message = Message(stream, self._readings, stamp, header, reading.taken, (), reading)
            self._write(message)

    def _run(self) -> None:
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        while True:
            messages = deque(self.subscriber.receive(0.2))
            if self.stopping and not messages:
                return
            counts = Counter(one.stream for one in messages)
            headers = [one.header for one in messages]
            last = replace(messages[-1], item=None) if messages else None
            while messages:
                # Each message is released as soon as it is written: frames are large.
                self._take(messages.popleft())
            self._note_drops()
            if last is not None:
                self._written(headers, last)
            self._rest(counts)

    def _rest(self, counts: Counter[str]) -> None:
        """Let messages gather after a batch of so many by stream; a stop ends the rest."""
        self._stopping.wait(self._pause.after(counts, self._reads))

    def _written(self, headers: list[Header], last: Message[None]) -> None:
        """Called when the messages with these headers are written; `last` has lost its item."""

    def _take(self, message: Message[Any]) -> None:
        self.follow(message.stamp)
        self._write(message)

    def _write(self, message: Message[Any]) -> None:
        self._show(message)
        if self._failure:
            return
        try:
            self._recorder.write(message)
        except RecordingError as error:
            self._failure = str(error)
            self.alert("recording_stopped", self._failure)

        if isinstance(message.item, Photo):
            self._keep(message.stream.partition("/")[0], message.item)

    def _show(self, message: Message[Any]) -> None:
        """Publish on ROS 2 topics; what fails there ends that, and no recording."""
        graph = self._ros
        if graph is None:
            return
        try:
            graph.put(message)
        except Exception as error:  # noqa: BLE001 - a middleware's
            self._ros = None
            graph.close()
            self.alert("ros2_stopped", failure_line(error))

    def _keep(self, robot: str, photo: Photo) -> None:
        """Keep a picture beside the recording; one that cannot be kept does not end it."""
        try:
            self._album.add(robot, photo)
        except RecordingError as error:
            self.alert("photo", str(error))

    def _note_drops(self) -> None:
        """Record dropped messages immediately, because the run may be killed."""
        assert self.subscriber is not None  # noqa: S101 - set by prepare
        for stream, dropped in self.subscriber.dropped.items():
            if dropped > self._lost[stream]:
                self._recorder.drops(stream, dropped - self._lost[stream])
                self._lost[stream] = dropped

    def _close(self) -> None:
        summary = self._recorder.close()
        if summary.stopped and self._error is None:
            self._error = RecordingError(summary.stopped)
        self._album.close()
        if self._live is not None:
            self._live.close()
        if self._ros is not None:
            self._ros.close()

    def _values(self) -> dict[str, Any]:
        return {"path": str(self._path), "failure": self._failure}


def _unwritten(path: Path) -> Path:
    """`path`, or the first of `flight.2.mcap`, `flight.3.mcap`, ... that does not exist."""
    parts = itertools.count(2)
    part = path
    while part.exists():
        part = path.with_suffix(f".{next(parts)}{path.suffix}")
    return part

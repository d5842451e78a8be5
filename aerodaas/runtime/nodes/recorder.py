"""Recorder node: writes every stream of a run to an MCAP file."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from aerodaas.config.extensions import added, imported, live_views
from aerodaas.config.options import LiveViews
from aerodaas.errors import RecordingError, failure_line
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.vitals import Vitals
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.sidecar import SidecarWriter
from aerodaas.runtime.node import Host, Node
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import vitals_stream

if TYPE_CHECKING:
    from aerodaas.recording.live import LiveServer
    from aerodaas.recording.recorder import FlightRecorder

__all__ = ["RecorderNode"]


class LiveMessages(Protocol):
    """Live view of the recorded messages in another program."""

    def put(self, message: Message[Any]) -> None:
        """Show a message."""

    def close(self) -> None:
        """End the view."""


class RecorderNode(Node):
    """Records its streams; a full disk ends the recording, not the flight."""

    def __init__(
        self,
        session: Session,
        path: Path,
        streams: Mapping[str, int],
        provenance: Provenance,
        views: LiveViews | None = None,
    ) -> None:
        """Record to a new file.

        Args:
            session: The run.
            path: Path of the MCAP file; if it exists, the first of `flight.2.mcap`,
                `flight.3.mcap`, … that does not.
            streams: Queue depths of the streams to record.
            provenance: Versions, configuration and application, for the file's metadata.
            views: Who looks on at what is recorded.
        """
        super().__init__("recorder", streams)
        self.path = path
        self.failure = ""
        """Why the recording had to stop; empty while it goes on."""
        self._session = session
        self._provenance = provenance
        self._views = views or LiveViews()
        self._readings = 0
        self._recorder: FlightRecorder | None = None
        self._sidecars: list[SidecarWriter] = []
        self._live: LiveServer | None = None
        self._shown: dict[str, LiveMessages] = {}

    def open(self, host: Host) -> None:
        """Create the file; raises RecordingError if it cannot be written."""
        super().open(host)
        # The application's process imports this module, but does not need the writers.
        from aerodaas.recording.live import LiveServer  # noqa: PLC0415
        from aerodaas.recording.recorder import FlightRecorder  # noqa: PLC0415

        environment = self._session.environment
        home = environment.home
        address = self._views.foxglove
        self._live = LiveServer(address, self._provenance.name) if address else None
        known = live_views()
        quality = environment.recording.jpeg_quality
        for name, place in self._views.others.items():
            view = imported(known[name].open)
            self._shown[name] = view(place, self._provenance.started_ns, quality)
        # A recorder that is set up again keeps its predecessor's file and writes a second part.
        self.path = _unwritten(self.path)
        self._sidecars = [kind(self.path, environment) for kind in added("sidecar_writers")]
        self._recorder = FlightRecorder(
            self.path,
            config=environment.recording,
            provenance=self._provenance,
            home=GeodeticOrigin(home.latitude, home.longitude, home.altitude) if home else None,
            fences={robot.id: robot.limits.geofence for robot in environment.robots},
            live=self._live,
        )

    @property
    def shows_live(self) -> bool:
        """Whether anybody looks on at what is recorded."""
        return self._views != LiveViews()

    def step(self, now: int, inputs: Sequence[Message[Any]]) -> Sequence[Message[Any]]:
        """Write the messages.

        Args:
            now: Ignored.
            inputs: New messages, each stream's in order.
        """
        del now
        for message in inputs:
            self.write(message)
        return ()

    def write(self, message: Message[Any]) -> None:
        """Write one message; thread-safe."""
        self._show(message)
        if self.failure or self._recorder is None:
            return
        try:
            self._recorder.write(message)
        except RecordingError as error:
            self.failure = str(error)
            self.host.alert("recording_stopped", self.failure)
        for sidecar in self._sidecars:
            self._write_beside(sidecar, message)

    def _write_beside(self, sidecar: SidecarWriter, message: Message[Any]) -> None:
        try:
            sidecar.write(message)
        except RecordingError as error:
            self.host.alert(sidecar.kind, str(error))

    def write_vitals(self, readings: Mapping[str, Vitals], now: int) -> None:
        """Record the vitals of the run's processes.

        Args:
            readings: Vitals by `part@machine`.
            now: Mission time, nanoseconds.
        """
        self._readings += 1
        for source, reading in readings.items():
            stream = vitals_stream(source.partition("@")[0])
            header = Header(self._readings, now, source)
            self.write(Message(stream, self._readings, now, header, reading.taken, (), reading))

    def count_drops(self, stream: str, count: int) -> None:
        """Record at once that messages were dropped, because the run may be killed.

        Args:
            stream: Name of the stream.
            count: Messages dropped.
        """
        if self._recorder is not None:
            self._recorder.drops(stream, count)

    def _show(self, message: Message[Any]) -> None:
        """Show a message in each live view; what fails there ends that view, and no recording."""
        for name in tuple(self._shown):
            self._show_in(name, message)

    def _show_in(self, name: str, message: Message[Any]) -> None:
        view = self._shown.get(name)
        try:
            if view is not None:
                view.put(message)
        except Exception as error:  # noqa: BLE001 - an extension's
            # Another thread may have ended it by the same failure.
            if (ended := self._shown.pop(name, None)) is not None:
                ended.close()
                self.host.alert(f"{name}_stopped", failure_line(error))

    def close(self) -> None:
        """Finish the file; raises RecordingError if the recording had to stop."""
        if self._recorder is None:
            return
        summary = self._recorder.close()
        for sidecar in self._sidecars:
            sidecar.close()
        if self._live is not None:
            self._live.close()
        for view in self._shown.values():
            view.close()
        self._shown = {}
        self._recorder = None
        if summary.stopped:
            raise RecordingError(summary.stopped)

    def values(self) -> dict[str, Any]:
        """Path of the file, and why the recording had to stop."""
        return {"path": str(self.path), "failure": self.failure}


def _unwritten(path: Path) -> Path:
    """`path`, or the first of `flight.2.mcap`, `flight.3.mcap`, ... that does not exist."""
    parts = itertools.count(2)
    part = path
    while part.exists():
        part = path.with_suffix(f".{next(parts)}{path.suffix}")
    return part

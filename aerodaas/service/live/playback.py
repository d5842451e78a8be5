"""Recordings played on the page: each is read once, and its pictures by the moment asked for."""

from __future__ import annotations

import json
import logging
import threading
from collections import OrderedDict
from pathlib import Path

from aerodaas.errors import AeroDaaSError, ConfigError, RecordingError
from aerodaas.protocol.playback import PlaybackOut
from aerodaas.recording.playback.flight import read_flight
from aerodaas.recording.playback.frame_index import FrameIndex
from aerodaas.recording.reader import Recording

__all__ = ["Player", "Players"]

_log = logging.getLogger(__name__)
_MOST_OPEN = 4
"""Recordings that are kept open; who comes back to another one waits until it is read again."""


class Player:
    """One recording; safe in any thread."""

    def __init__(self, path: Path, recording: Recording | None = None) -> None:
        """Begin to read a recording in a thread; `recording` is the one at `path`, if open."""
        self._path = path
        self._recording = recording
        self._lock = threading.Lock()
        self._frames: FrameIndex | None = None
        self._closed = False
        self._problem = ""
        self._read = 0.0
        self._text = b""
        threading.Thread(target=self._begin, name="playback", daemon=True).start()

    @property
    def text(self) -> bytes:
        """A PlaybackOut as JSON; raises RecordingError for a recording that cannot be read."""
        self._require_readable()
        return self._text or PlaybackOut(read=self._read).model_dump_json().encode()

    def picture(self, stream: str, time: int, *, depth: bool = False) -> bytes:
        """The last picture captured at or before a time, and what was found in it.

        Args:
            stream: Name of a stream of pictures.
            time: Mission nanoseconds.
            depth: Whether its depth is wanted, too.

        Returns:
            One line of JSON, a list of messages as a live view sends them; after it the bytes of
            each one that has some. The list is empty before the first picture.

        Raises:
            RecordingError: If the recording has not been read yet, or cannot be.
            ConfigError: If there is no such stream.
        """
        self._require_readable()
        with self._lock:
            if self._frames is None or self._closed:
                raise RecordingError("the recording is being read; ask again in a moment")
            try:
                items = self._frames.at(stream, time, depth=depth)
            except KeyError:
                raise ConfigError(f"the recording shows no camera {stream!r}") from None
            except OSError as error:
                raise RecordingError(f"cannot read the recording: {error.strerror}") from None
        messages = json.dumps([message for message, _ in items]).encode()
        return messages + b"\n" + b"".join(blob for _, blob in items)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._closed = True
            # While it is read for the first time, its reader closes it.
            if self._recording is not None and (self._frames is not None or self._problem):
                self._recording.close()

    def _require_readable(self) -> None:
        if self._problem:
            raise RecordingError(self._problem)

    def _begin(self) -> None:
        problem, frames, text, recording = "", None, b"", self._recording
        try:
            # One that was cut off is scanned whole, which may take a while.
            recording = recording or Recording.open(self._path)
            flight, frames = read_flight(recording, self._set_progress)
            text = PlaybackOut(read=1.0, flight=flight).model_dump_json().encode()
        except AeroDaaSError as error:
            # Where it lies at a provider is nobody else's business.
            problem = str(error).replace(str(self._path), self._path.name)
        except OSError as error:
            problem = f"cannot read {self._path.name}: {error.strerror}"
        except Exception:  # noqa: BLE001 - whatever a stranger's file brings about, its viewer is told
            problem = f"{self._path.name} cannot be read"
            _log.exception("reading %s", self._path)
        with self._lock:
            self._recording, self._frames, self._text = recording, frames, text
            self._problem = problem
            if self._closed and recording is not None:
                recording.close()

    def _set_progress(self, read: float) -> None:
        self._read = read
        if self._closed:
            # Nobody looks, and who goes from one to the next would have all of them read at once.
            raise RecordingError(f"{self._path.name} was closed while it was read")


class Players:
    """Recordings by the mission that they are of; safe in any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: OrderedDict[str, Player] = OrderedDict()

    def of(self, mission: str, path: Path) -> Player:
        """The player of a mission's recording.

        Args:
            mission: Id of the mission.
            path: File of the recording.
        """
        with self._lock:
            known = self._open.get(mission)
            if known is None:
                known = self._open[mission] = Player(path)
                while len(self._open) > _MOST_OPEN:
                    self._open.popitem(last=False)[1].close()
            self._open.move_to_end(mission)
            return known

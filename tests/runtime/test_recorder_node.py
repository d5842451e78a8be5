"""The recorder node: one file, further parts, vitals, and a disk that is full."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from hosts import Hand, published

from aerodaas.clock import NANOSECONDS
from aerodaas.config.model import EnvironmentConfig
from aerodaas.errors import RecordingError
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.readings import Alert
from aerodaas.messages.vitals import read_vitals
from aerodaas.recording.output import Output
from aerodaas.recording.provenance import Provenance
from aerodaas.recording.reader import Recording
from aerodaas.runtime.nodes.recorder import RecorderNode
from aerodaas.runtime.session import Session
from aerodaas.runtime.stream_names import alert_stream

_STREAM = alert_stream("part")
_PROVENANCE = Provenance(name="test", config="{}")


def opened(path: Path, host: Hand) -> RecorderNode:
    """A node that records alerts to a new file."""
    environment = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
    node = RecorderNode(Session(environment, None), path, {_STREAM: 8}, _PROVENANCE)
    node.open(host)
    return node


def alert(text: str, seconds: int) -> Message[Alert]:
    """A message to record."""
    stamp = seconds * NANOSECONDS
    return published(_STREAM, Alert(Header(seconds, stamp, "part"), "kind", text), stamp, seconds)


def texts(path: Path) -> list[str]:
    """Alerts of a recording."""
    with Recording.open(path) as recording:
        assert recording.complete
        found = recording.records(schemas=["aerodaas.Alert"])
        return [record.value.text for record in found]


def test_messages_are_written_to_the_file(tmp_path: Path) -> None:
    """Complete once the node has been closed."""
    node = opened(tmp_path / "flight.mcap", Hand())
    assert list(node.step(0, [alert("one", 1), alert("two", 2)])) == []
    assert list(node.step(0, [alert("three", 3)])) == []
    node.close()
    node.close()
    assert texts(node.path) == ["one", "two", "three"]
    assert node.values() == {"path": str(node.path), "failure": ""}


def test_a_recorder_that_is_set_up_again_writes_a_further_part(tmp_path: Path) -> None:
    """Its predecessor's file stays as it is."""
    path = tmp_path / "flight.mcap"
    for number in range(3):
        node = opened(path, Hand())
        node.step(0, [alert(f"part {number}", 1)])
        node.close()
    parts = [path, tmp_path / "flight.2.mcap", tmp_path / "flight.3.mcap"]
    assert [texts(part) for part in parts] == [["part 0"], ["part 1"], ["part 2"]]


def test_vitals_are_recorded_by_process(tmp_path: Path) -> None:
    """With the mission time at which they were read."""
    node = opened(tmp_path / "flight.mcap", Hand())
    node.write_vitals({"inline@host": read_vitals()}, 4 * NANOSECONDS)
    node.write_vitals({"inline@host": read_vitals()}, 5 * NANOSECONDS)
    node.close()
    with Recording.open(node.path) as recording:
        found = list(recording.records(schemas=["aerodaas.Vitals"]))
    assert [record.stamp for record in found] == [4 * NANOSECONDS, 5 * NANOSECONDS]


def test_a_full_disk_ends_the_recording_and_not_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """People are told once; what was written before can be read, and closing tells why it ended."""
    full = [False]
    write = Output.write

    def limited(output: Output, data: bytes) -> int:
        if full[0]:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(output, data)

    monkeypatch.setattr(Output, "write", limited)
    host = Hand()
    node = opened(tmp_path / "flight.mcap", host)
    node.step(0, [alert("kept", 1)])
    seconds = 2
    # Another thread writes, in batches that are gathered and compressed before.
    while not node.failure:
        assert seconds < 10_000
        full[0] = full[0] or node.path.stat().st_size > 4_000_000
        node.step(0, [alert(os.urandom(50_000).hex(), seconds)])
        seconds += 1
    for _ in range(3):
        node.step(0, [alert("lost", seconds)])
    assert [told.kind for told in host.alerts] == ["recording_stopped"]
    assert "No space left on device" in host.alerts[0].text
    assert node.values()["failure"] == host.alerts[0].text
    with pytest.raises(RecordingError, match="No space left on device"):
        node.close()
    with Recording.open(node.path) as recording:
        found = [record.value.text for record in recording.records(schemas=["aerodaas.Alert"])]
    assert found[0] == "kept"
    assert "lost" not in found


def test_a_file_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    """Nothing is left to close."""
    (tmp_path / "file").write_text("")
    environment = EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]})
    path = tmp_path / "file" / "flight.mcap"
    node = RecorderNode(Session(environment, None), path, {_STREAM: 8}, _PROVENANCE)
    with pytest.raises(RecordingError):
        node.open(Hand())
    node.close()

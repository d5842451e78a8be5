"""Graphics processors in the vitals: there where NVIDIA's library tells, absent elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from synthetic_flight import PROVENANCE

from aerodaas.config.model import RecordingConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.vitals import _nvml, read_vitals
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorder import FlightRecorder
from aerodaas.recording.report.flight import RecordedFlight


class Nvml:
    """NVIDIA's library as its package shows it, with two processors, one of them mute."""

    class NVMLError(Exception):
        """As the package's own."""

    def __init__(self, *, driver: bool = True) -> None:
        self.driver = driver

    def nvmlInit(self) -> None:  # noqa: N802 - the library's own names
        """Fail without a driver."""
        if not self.driver:
            raise self.NVMLError

    def nvmlDeviceGetCount(self) -> int:  # noqa: N802
        """Two."""
        return 2

    def nvmlDeviceGetHandleByIndex(self, index: int) -> int:  # noqa: N802
        """The index itself."""
        return index

    def nvmlDeviceGetUtilizationRates(self, handle: int) -> SimpleNamespace:  # noqa: N802
        """The second does not tell."""
        if handle == 1:
            raise self.NVMLError
        return SimpleNamespace(gpu=75, memory=30)

    def nvmlDeviceGetMemoryInfo(self, handle: int) -> SimpleNamespace:  # noqa: ARG002, N802
        """A quarter is in use."""
        return SimpleNamespace(total=8 << 30, free=6 << 30, used=2 << 30)


@pytest.fixture
def nvml(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Nvml | None], None]]:
    """Put a library in the place of NVIDIA's, or nothing."""

    def put(library: Nvml | None) -> None:
        monkeypatch.setitem(sys.modules, "pynvml", library)
        _nvml.cache_clear()

    yield put
    _nvml.cache_clear()


def test_graphics_processors_are_recorded(
    nvml: Callable[[Nvml | None], None], tmp_path: Path
) -> None:
    """What NVML tells of comes back from the file; a processor that says nothing is left out."""
    nvml(Nvml())
    path = tmp_path / "vitals.mcap"
    with FlightRecorder(path, config=RecordingConfig(), provenance=PROVENANCE) as recorder:
        for number in range(2):
            header = Header(number, number * 10**9, "drone/tello@node")
            message = Message("@vitals/a", number, header.stamp, header, 0, (), read_vitals())
            recorder.write(message)
    with Recording.open(path) as recording:
        (load,) = RecordedFlight.read(recording).gpus.values()
    assert (load.cpu, load.memory) == ([0.75, 0.75], [0.25, 0.25])


@pytest.mark.parametrize("library", [None, Nvml(driver=False)], ids=["no package", "no driver"])
def test_machine_without_graphics_processor(
    nvml: Callable[[Nvml | None], None], library: Nvml | None
) -> None:
    """Vitals are read all the same."""
    nvml(library)
    assert read_vitals().gpus == ()

"""Load of the machine's NVIDIA GPUs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

from aerodaas.types.records import fast_pickle

__all__ = ["GpuLoad", "read_gpus"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class GpuLoad:
    """One graphics processor at one moment."""

    busy: float
    """Share of the last moments in which it worked, 0 to 1."""
    memory: float
    """Share of its memory in use, 0 to 1."""


def read_gpus() -> tuple[GpuLoad, ...]:
    """Read every processor that NVML shows; none without its package, driver or a processor."""
    nvml = _nvml()
    if nvml is None:
        return ()
    found = []
    for index in range(nvml.nvmlDeviceGetCount()):
        try:
            handle = nvml.nvmlDeviceGetHandleByIndex(index)
            busy = nvml.nvmlDeviceGetUtilizationRates(handle).gpu
            memory = nvml.nvmlDeviceGetMemoryInfo(handle)
        except nvml.NVMLError:
            # One that is lost, or does not tell (as a share of a divided processor).
            continue
        found.append(GpuLoad(busy / 100, memory.used / memory.total if memory.total else 0.0))
    return tuple(found)


@cache
def _nvml() -> Any:  # noqa: ANN401 - an optional package without types
    try:
        import pynvml  # noqa: PLC0415 - the extra `gpu`
    except ImportError:
        return None
    try:
        pynvml.nvmlInit()
    except pynvml.NVMLError:
        return None
    return pynvml

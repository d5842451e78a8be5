"""Resources used by a process, and the load of its machine and of its NVIDIA GPUs."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache
from typing import Any

import psutil

from aerodaas.clock import host_time_ns
from aerodaas.messages.serialization.json_types import Int64
from aerodaas.messages.serialization.records import fast_pickle

__all__ = ["GpuLoad", "Vitals", "read_gpus", "read_vitals"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class GpuLoad:
    """One graphics processor at one moment."""

    busy: float
    """Share of the last moments in which it worked, 0 to 1."""
    memory: float
    """Share of its memory in use, 0 to 1."""


@fast_pickle
@dataclass(frozen=True, slots=True)
class Vitals:
    """One process and its machine at one moment."""

    taken: Int64
    """`clock.host_time_ns` of the reading."""
    cpu_seconds: float
    """Processor time that the process has used since it started, all its threads together."""
    memory: Int64
    """Bytes of the process in memory, shared memory included."""
    machine_cpu: float
    """Share of all the machine's cores that was busy since the last reading, 0 to 1."""
    machine_memory: float
    """Share of the machine's memory in use, 0 to 1."""
    gpus: tuple[GpuLoad, ...] = ()
    """The machine's graphics processors; none where they cannot be read."""


@cache
def _process() -> psutil.Process:
    return psutil.Process()


def read_vitals() -> Vitals:
    """Read this process's vitals; takes some tenths of a millisecond."""
    return Vitals(
        taken=host_time_ns(),
        cpu_seconds=time.process_time(),
        memory=int(_process().memory_info().rss),
        machine_cpu=float(psutil.cpu_percent(None)) / 100,
        machine_memory=float(psutil.virtual_memory().percent) / 100,
        gpus=read_gpus(),
    )


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

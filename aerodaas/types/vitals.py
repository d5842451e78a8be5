"""Resources used by a process, and the load of its machine."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache

import psutil

from aerodaas.types.clock import host_time_ns
from aerodaas.types.gpu import GpuLoad, read_gpus
from aerodaas.types.records import fast_pickle

__all__ = ["Vitals", "read_vitals"]


@fast_pickle
@dataclass(frozen=True, slots=True)
class Vitals:
    """One process and its machine at one moment."""

    taken: int
    """`clock.host_time_ns` of the reading."""
    cpu_seconds: float
    """Processor time that the process has used since it started, all its threads together."""
    memory: int
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

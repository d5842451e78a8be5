"""The laboratory: a discrete-event simulator that drives the analytics schedulers."""

from __future__ import annotations

from aerodaas.schedulers.lab.arrival_trace import read_arrivals
from aerodaas.schedulers.lab.network import ExecutionTimes, Network
from aerodaas.schedulers.lab.run import LabResult, run_lab
from aerodaas.schedulers.lab.sweep import SweepResult, run_sweep
from aerodaas.schedulers.lab.workload import Workload, load_workload

__all__ = [
    "ExecutionTimes",
    "LabResult",
    "Network",
    "SweepResult",
    "Workload",
    "load_workload",
    "read_arrivals",
    "run_lab",
    "run_sweep",
]

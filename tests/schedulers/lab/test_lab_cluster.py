"""The lab over a Ray cluster."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodaas.cli.lab.app import app
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.lab import Workload, run_lab

_MINE = """
from aerodaas.schedulers.analytics import AnalyticsScheduler, Drop

class Mine(AnalyticsScheduler):
    def task_arrived(self, task, now):
        return [Drop(task)]
"""


def _address() -> str:
    import ray  # noqa: PLC0415 - only where Ray runs

    return str(ray.get_runtime_context().gcs_address)


@pytest.mark.slow
def test_a_cluster_gives_the_same_figures(runtime: None) -> None:  # noqa: ARG001 - starts Ray
    """In the order of the seeds, as one process does."""
    from aerodaas.actors.cluster.ray_map import spread_over  # noqa: PLC0415 - loads ray

    load = Workload.named("4D-A/2", 5 * NANOSECONDS)
    arguments = (load, ["ec_edf", "margin"], range(6))
    there = run_lab(*arguments, spread=spread_over(_address()), bound=False)
    assert there == run_lab(*arguments, jobs=1, bound=False)


@pytest.mark.slow
def test_a_class_of_ones_own_travels_to_the_cluster(runtime: None, tmp_path: Path) -> None:  # noqa: ARG001 - starts Ray
    """With its code, for its file is not on the other machines."""
    mine = tmp_path / "travelling.py"
    mine.write_text(_MINE)
    arguments = ["run", "-w", "2D-P", "-s", f"ec_edf,{mine}:Mine", "--seeds", "2"]
    arguments += ["--duration", "3", "--address", _address()]
    outcome = CliRunner().invoke(app, arguments, env={"COLUMNS": "220"})
    assert outcome.exit_code == 0, outcome.output
    assert re.search(r"Mine .* 0\.0", outcome.output)


@pytest.mark.slow
def test_what_a_scheduler_raises_there_is_told_here(runtime: None, tmp_path: Path) -> None:  # noqa: ARG001 - starts Ray
    """In one line, with the seed and the edge, and without the other process' traceback."""
    mine = tmp_path / "breaking.py"
    mine.write_text(_MINE.replace("return [Drop(task)]", "raise RuntimeError(task.source)"))
    arguments = ["run", "-w", "1D-P", "--edges", "2", "-s", f"{mine}:Mine", "--seeds", "1"]
    arguments += ["--duration", "3", "--address", _address()]
    outcome = CliRunner().invoke(app, arguments, env={"COLUMNS": "220"})
    assert isinstance(outcome.exception, SchedulerError)
    assert "Mine with seed 0 on edge 0: RuntimeError: drone0" in str(outcome.exception)

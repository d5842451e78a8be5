"""What is found out of an application that stops, and of one that is looked for elsewhere."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import pytest

from aerodaas.actors.cluster.orphan_reaper import ApplicationProcess
from aerodaas.actors.run.losses import SuspensionMonitor


def test_an_application_in_another_container_is_not_looked_for_here(runtime: None) -> None:  # noqa: ARG001
    """Its number means another process here, or none: it lives for as long as it is heard."""
    here = ApplicationProcess(time_waits=False)
    assert here.near
    assert not here.ended()
    assert not replace(here, pids="pid:[1]").near
    assert not replace(here, node="another").near


def test_a_process_that_has_the_number_of_an_earlier_one_is_another(runtime: None) -> None:  # noqa: ARG001
    """And one that waits for its parent has ended."""
    here = ApplicationProcess(time_waits=False)
    assert replace(here, began=here.began - 100).ended()
    child = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    began = here.began
    assert replace(here, pid=child.pid, began=began).ended()
    child.wait()
    assert replace(here, pid=child.pid).ended()


def test_only_a_pause_between_two_beats_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not what came before the first one: a start may take long."""
    now = 100.0
    monkeypatch.setattr("aerodaas.actors.run.losses.time.monotonic", lambda: now)
    pulse = SuspensionMonitor()
    now += 60.0
    pulse.beat()
    assert pulse.frozen == 0.0
    now += 1.0
    pulse.beat()
    assert pulse.frozen == 0.0
    now += 7.0
    pulse.beat()
    assert pulse.frozen == 7.0

"""What tests need beyond the project's own packages, and the few peers that may be missing in CI.

What is missing skips its tests, with the remedy as the reason; where the variable `CI` is set, such
a skip is a failure. Three kinds may stay out there, too: tests of a peer that the environment does
not name, tests for a newer Python, and tests of training without PyTorch, which `make test-all`
installs. This module is a plugin of pytest, which `conftest.py` registers.
"""

from __future__ import annotations

import importlib.util
import os
import re
import shutil
import sys
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import pytest

from tools.browser import BROWSERS

__all__ = ["PEERS", "needs", "needs_peer", "needs_python", "needs_root", "peer"]

_Report = TypeVar("_Report", pytest.TestReport, pytest.CollectReport)


@dataclass(frozen=True)
class Peer:
    """Somebody else's program or data that the project is held against."""

    names: str
    """What its variable names, and where it may be had."""
    programs: tuple[str, ...] = ()
    """Where the variable is not set, the first of these that is installed is taken."""
    beside: tuple[str, ...] = ()
    """Programs that must be installed, too."""


PEERS = {
    "AERODAAS_SITL_PX4": Peer(
        "a PX4 in simulation, by a URL such as udpin:127.0.0.1:14540 or `start command => URL`"
    ),
    "AERODAAS_SITL_ARDUPILOT": Peer(
        "an ArduCopter in simulation, by a URL such as tcp:127.0.0.1:5760 or `start command => URL`"
    ),
    "AERODAAS_ARDUPILOT": Peer(
        "ArduCopter's program for simulation, with its source tree around it or beside it",
        ("arducopter",),
    ),
    "AERODAAS_MAVSDK": Peer("a Python with MAVSDK: tests/testing/test_mavsdk.py"),
    "AERODAAS_DJITELLOPY": Peer("a Python with djitellopy: tests/testing/test_djitellopy.py"),
    "AERODAAS_BROWSER": Peer("a Chromium or Chrome", BROWSERS),
    "AERODAAS_NPM": Peer("Node.js' npm, with its registry in reach", ("npm",), ("node",)),
    "AERODAAS_SSHD": Peer(
        "OpenSSH's server, with ssh, ssh-keygen and rsync installed, too",
        ("/usr/sbin/sshd",),
        ("ssh", "ssh-keygen", "rsync"),
    ),
    "AERODAAS_TEST_DATABASE": Peer(
        "an empty PostgreSQL database, by a URL such as postgresql://USER@127.0.0.1/NAME"
    ),
    "AERODAAS_FASTDDS": Peer(
        "Fast DDS' fastddsgen, with libfastrtps-dev and g++ (Debian: fastddsgen libfastrtps-dev)",
        ("fastddsgen",),
        ("g++",),
    ),
    "AERODAAS_TEST_DATA": Peer(
        "a folder of real pictures and models: tests/analytics/detection/test_real_models.py"
    ),
}
"""All that may be missing in continuous integration, by the variable that names it."""


def peer(variable: str) -> str:
    """What the environment names by `variable`; empty if it is missing."""
    wanted = PEERS[variable]
    if not all(map(shutil.which, wanted.beside)):
        return ""
    found = next(filter(None, map(shutil.which, wanted.programs)), "")
    return os.environ.get(variable, "") or found


def needs_peer(variable: str) -> pytest.MarkDecorator:
    """Mark a test that runs only where the environment names this peer."""
    assert variable in PEERS
    return pytest.mark.needs_peer(variable)


def needs_python(*version: int, because: str) -> pytest.MarkDecorator:
    """Mark a test that runs on this Python and newer only."""
    return pytest.mark.needs_python(version, because)


def needs(there: object, remedy: str) -> pytest.MarkDecorator:
    """Mark a test that needs what is there or not; `remedy` says how to get it."""
    return pytest.mark.skipif(not there, reason=remedy)


needs_root = needs(os.geteuid() == 0, "network namespaces need root: run the tests as root")
"""Marks a test that makes network namespaces."""


def pytest_configure(config: pytest.Config) -> None:
    """Make the markers known."""
    config.addinivalue_line("markers", "needs_peer(variable): runs where a variable names a peer")
    config.addinivalue_line("markers", "needs_python(version, because): runs on newer Pythons only")


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what may stay out."""
    reason = _why_out(item)
    if reason:
        pytest.skip(reason)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """In continuous integration, no other test is skipped."""
    report = yield
    return report if _why_out(item) else _refuse_skip(report)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """In continuous integration, no module is skipped but those of training."""
    report = yield
    return report if isinstance(collector, _WithoutTorch) else _refuse_skip(report)


def pytest_pycollect_makemodule(
    module_path: Path, parent: pytest.Collector
) -> pytest.Module | None:
    """Skip what trains models where PyTorch is missing."""
    training = re.search(r"^(import|from) torch\b", module_path.read_text(), re.MULTILINE)
    if training and importlib.util.find_spec("torch") is None:
        return _WithoutTorch.from_parent(parent, path=module_path)
    return None


class _WithoutTorch(pytest.Module):
    def collect(self) -> list[pytest.Item | pytest.Collector]:
        pytest.skip("training needs PyTorch: make training", allow_module_level=True)


def _why_out(item: pytest.Item) -> str:
    for marker in item.iter_markers("needs_peer"):
        (variable,) = marker.args
        if not peer(variable):
            return f"set {variable} to {PEERS[variable].names}"
    for marker in item.iter_markers("needs_python"):
        version, because = marker.args
        if sys.version_info < version:
            return f"needs Python {'.'.join(map(str, version))}: {because}"
    return ""


def _refuse_skip(report: _Report) -> _Report:
    if os.environ.get("CI") and report.skipped and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        report.outcome = "failed"
        report.longrepr = f"missing, in continuous integration: {reason}"
    return report

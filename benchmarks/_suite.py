"""What `make bench` runs, each in its shortest meaningful form, and what the others are."""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from tools.browser import BROWSERS

__all__ = ["OTHERS", "SPEED", "Benchmark", "Need"]


@dataclass(frozen=True)
class Need:
    """What a benchmark needs beside the project's core."""

    what: str
    there: Callable[[], bool]
    remedy: str
    without: tuple[str, ...] | None = None
    """Options that leave out what is missing, a peer's figures; None if nothing runs without it."""


@dataclass(frozen=True)
class Benchmark:
    """A benchmark of speed or size."""

    name: str
    words: tuple[str, ...] = ()
    """Options of its shortest form that says something."""
    needs: tuple[Need, ...] = field(default=(), kw_only=True)

    def program(self) -> list[str]:
        """Words for Python: the short form, without the peers that this machine lacks."""
        without = [word for need in self.missing for word in need.without or ()]
        return [f"benchmarks/{self.name}.py", *self.words, *without]

    def command(self) -> str:
        """The short form as one types it."""
        return shlex.join(["python", *self.program()])

    @property
    def missing(self) -> list[Need]:
        """What this machine lacks of it."""
        return [need for need in self.needs if not need.there()]

    @property
    def lacks(self) -> bool:
        """True if it cannot run here, for more than a peer is missing."""
        return any(need.without is None for need in self.missing)


def _package(name: str, remedy: str, *, without: tuple[str, ...] | None = None) -> Need:
    return Need(name, lambda: importlib.util.find_spec(name) is not None, remedy, without)


def _has_browser() -> bool:
    return bool(os.environ.get("AERODAAS_BROWSER") or any(map(shutil.which, BROWSERS)))


def _has_dora() -> bool:
    program = Path(sys.executable).parent / "dora"
    return importlib.util.find_spec("dora") is not None and program.is_file()


_ALL = "pip install -e '.[all]'"
_BROWSER = Need(
    "a browser",
    _has_browser,
    f"install {' or '.join(BROWSERS)}, or name one by AERODAAS_BROWSER",
)
_DJITELLOPY = Need(
    "djitellopy",
    lambda: bool(os.environ.get("AERODAAS_DJITELLOPY")),
    "name the Python of an environment with djitellopy by AERODAAS_DJITELLOPY",
    without=(),
)
_DORA = Need("dora", _has_dora, "pip install -e '.[benchmarks]'", without=("--no-dora",))
_ROOT = Need("root", lambda: os.geteuid() == 0, "run it as root, which network namespaces need")
_ROUTES = _package("pyvrp", f"{_ALL}, by Python 3.11 or newer")
_SERVICE = _package("sqlalchemy", _ALL)
_CONSOLE = _package("uvicorn", _ALL)

SPEED = tuple(
    Benchmark(name, tuple(words.split()), needs=needs)
    for name, words, needs in (
        ("start", "--runs 9 --flights 3", ()),
        ("latency", "--seconds 5 --rounds 1", (_DORA,)),
        ("trace", "--seconds 5", ()),
        ("hop", "--count 100 --rounds 1", ()),
        ("punctuality", "--seconds 10 --measures", ()),
        ("restart", "--times 1", ()),
        ("footprint", "--case hover,camera --seconds 8", ()),
        ("simulation", "--rounds 1 --seeds 2", ()),
        ("decision", "--waiting 100", ()),
        ("lab", "--scheduler all --edges=", ()),
        ("routes", "--size 50 --seeds 2 --long-run 5", (_ROUTES,)),
        ("vision", "aerodaas/analytics/models/detector.onnx --rounds 30", ()),
        ("recording", "--drones 1 --seconds 5", ()),
        ("console", "--seconds 3 --commands 4 --viewers 0 --viewers 5", (_CONSOLE, _BROWSER)),
        ("service", "--drones 5 --watchers 20 --missions 40 --seconds 10", (_SERVICE,)),
        ("mavlink", "--seconds 5", ()),
        ("tello", "--seconds 5", (_DJITELLOPY,)),
        ("cluster", "--seconds 3 --rtt 40 --no-failures", (_ROOT,)),
    )
)
"""Benchmarks that `make bench` runs, in this order."""

OTHERS = {
    "scale": ("sudo python benchmarks/scale.py --rates 15", "takes long"),
    "endurance": ("python benchmarks/endurance.py --minutes 120", "takes hours"),
    "schedulers": ("python benchmarks/schedulers.py --seeds 10", "judges schedulers, simulated"),
    "fairness": ("python benchmarks/fairness.py", "judges schedulers, simulated"),
    "shared_edge": ("python benchmarks/shared_edge.py", "judges how tenants share an edge"),
    "lab_vs_live": ("python benchmarks/lab_vs_live.py", "judges the lab by flights"),
    "edge_and_cloud": ("python benchmarks/edge_and_cloud.py", "judges flights"),
    "paper": ("python benchmarks/paper.py --seeds 20", "judges flights over many seeds"),
    "agents": ("python benchmarks/agents.py", "judges flights of scripted answers"),
    "following": ("python benchmarks/following.py", "judges flights over many seeds"),
    "meetings": ("python benchmarks/meetings.py --seeds 20", "judges flights over many seeds"),
    "crossings": ("python benchmarks/crossings.py --seeds 20", "judges flights over many seeds"),
    "falls": ("python benchmarks/falls.py", "judges detection over many seeds"),
    "track": ("python benchmarks/track.py --from ~/ardupilot", "flies real autopilots"),
    "fly_baselines": ("python benchmarks/fly_baselines.py", "judges programs of others"),
    "lines_of_code": ("python benchmarks/lines_of_code.py", "counts lines of applications"),
    "structure": ("python benchmarks/structure.py", "counts lines and modules"),
    "walks": ("python benchmarks/walks.py", "lists files"),
    "mutation": (
        "python benchmarks/mutation.py aerodaas/mission/navigation/queue.py --sample 60",
        "judges tests",
    ),
}
"""Commands of the benchmarks that are left out, and why."""

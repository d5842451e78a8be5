"""An application's file: run whole, or for the environment that it offers without flying.

`aerodaas check`, `compile` and `submit` run an application for its graph alone. Its file
then runs up to the call that would wait for the flight: no hook runs, nothing starts, and what
stands after that call does not run either.
"""

from __future__ import annotations

import atexit
import runpy
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from aerodaas.config.options import RunOptions, current_options
from aerodaas.errors import GoesOnError, GraphError
from aerodaas.mission.commands import Command

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment

__all__ = [
    "BuildEndedError",
    "BuildOnlyMission",
    "note_built",
    "offer",
    "offered",
    "require_no_more",
    "run_file",
    "the_only",
]

_offered: ContextVar[list[Environment] | None] = ContextVar("offered", default=None)
"""Receiver of the environments that are ready; None where an application flies."""

_built: ContextVar[list[Environment] | None] = ContextVar("built", default=None)
"""Environments that the application's file has built; None in a process without one."""


class BuildEndedError(BaseException):
    """Ends an application that is only built where it would wait for its flight.

    No Exception: it is no failure, and must not have one told to people.
    """


@contextmanager
def offered() -> Iterator[list[Environment]]:
    """Have `start_mission()` offer its environment, into the list, instead of flying.

    The application ends where it would wait for its flight, or wants something of it; for the
    latter see `require_no_more`.
    """
    found: list[Environment] = []
    token = _offered.set(found)
    try:
        with suppress(GoesOnError, BuildEndedError):
            yield found
    finally:
        _offered.reset(token)


def run_file(application: Path, words: list[str], options: RunOptions) -> None:
    """Run the file as `__main__`, with its folder on the path.

    Args:
        application: Path of the Python file.
        words: Arguments that follow it in `sys.argv`.
        options: Options of the run, current for all that the file starts.

    Raises:
        GraphError: If it starts no environment of its own.
        Exception: The application's own.
    """
    current_options.set(options)
    sys.argv = [str(application), *words]
    sys.path.insert(0, str(application.resolve().parent))
    with _require_started():
        runpy.run_path(str(application), run_name="__main__")


def note_built(environment: Environment) -> None:
    """Note an environment of the application's file; of a script, tell at its end if none flew."""
    found = _built.get()
    if found is None:
        script = getattr(sys.modules["__main__"], "__file__", None)
        if script is None or not environment.line.startswith(f"{Path(script).name}:"):
            return
        found = []
        _built.set(found)
        atexit.register(_tell_unstarted, found)
    found.append(environment)


@contextmanager
def _require_started() -> Iterator[None]:
    """Raise GraphError, with the line, if an application builds environments and starts none."""
    found: list[Environment] = []
    token = _built.set(found)
    try:
        yield
    finally:
        _built.reset(token)
    if text := _unstarted(found):
        raise GraphError(text)


def _unstarted(found: Sequence[Environment]) -> str:
    if not found or any(environment.started for environment in found):
        return ""
    return f"it never called start_mission(), so nothing flies\n  at {found[0].line}"


def _tell_unstarted(found: Sequence[Environment]) -> None:
    text = _unstarted(found)
    # A script that has raised an exception has told why it did not come so far.
    if text and not hasattr(sys, "last_value"):
        print(f"error: {text}", file=sys.stderr)  # noqa: T201 - a script has no other voice


def offer(environment: Environment) -> BuildOnlyMission | None:
    """Offer an environment that is ready; None if it is to fly."""
    found = _offered.get()
    if found is None:
        return None
    found.append(environment)
    return BuildOnlyMission()


def require_no_more(environment: Environment) -> None:
    """Raise GoesOnError for an application that is more than the graph which it has offered."""
    if environment.unflown is not None and environment.unflown.asked:
        environment.unflown.refuse()


class BuildOnlyMission:
    """Stands in for the mission of an application that is only built: it never flies."""

    def __init__(self) -> None:
        """Stand in for one mission."""
        self.on_end: list[Callable[[], None]] = []
        self.asked = False
        """Whether the application wanted something of its flight."""

    @property
    def over(self) -> bool:
        """True: nothing flies."""
        return True

    def wait(self) -> NoReturn:
        """End the application: what comes next belongs to the end of a flight."""
        raise BuildEndedError

    def command(self, robot: str, command: Command) -> NoReturn:
        """Refuse a command."""
        del robot, command
        self.refuse()

    def read(self, stream: str) -> NoReturn:
        """Refuse to open a stream."""
        del stream
        self.refuse()

    def refuse(self) -> NoReturn:
        """Raise GoesOnError."""
        self.asked = True
        raise GoesOnError(
            "it goes on after start_mission() by code of its own: "
            "only `aerodaas run` flies such an application"
        )


def the_only(found: list[Environment]) -> Environment:
    """The one environment that was started; raises GraphError for none, or several."""
    if not found:
        raise GraphError("it never called start_mission()")
    if any(one is not found[0] for one in found):
        raise GraphError("it started several environments; there can be one")
    return found[0]

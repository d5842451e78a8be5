"""What the command line says about an exception, and the exit code."""

from __future__ import annotations

import traceback
from dataclasses import dataclass
from pathlib import Path

from aerodaas.config.options import current_options
from aerodaas.errors import AeroDaaSError, GraphError, InvalidWaypointError, UnknownIdError

__all__ = ["Failure", "failure_of", "show_failure"]

_CAUSED_BY_A_LINE = (GraphError, InvalidWaypointError, UnknownIdError)
"""Errors reported with the application's own line."""


@dataclass(frozen=True)
class Failure:
    """An exception in words."""

    text: str
    code: int
    """Exit code: 2 where the user's input is wrong, 1 otherwise."""


_WRONG_INPUT = 2
_INPUT_ERRORS = (ImportError, FileNotFoundError, NotADirectoryError, IsADirectoryError)
"""Of an application that cannot work, whatever happens in flight."""


def failure_of(error: Exception) -> Failure:
    """Describe an exception, with the application's own line where it helps."""
    if isinstance(error, AeroDaaSError):
        text = str(error)
        line = _application_line(error) if isinstance(error, _CAUSED_BY_A_LINE) else ""
        return Failure(
            text + (f"\n  at {line}" if line and "\n  at " not in text else ""), error.exit_code
        )
    if isinstance(error, SyntaxError):
        place = f"{error.filename}:{error.lineno}"
        return Failure(f"{place}: {error.msg}: {(error.text or '').strip()}", _WRONG_INPUT)
    line = _application_line(error)
    code = _WRONG_INPUT if isinstance(error, _INPUT_ERRORS) else 1
    return Failure(f"{type(error).__name__}: {error}" + (f"\n  at {line}" if line else ""), code)


def show_failure(failure: Failure) -> None:
    """Print a failure to standard error."""
    from rich.console import Console  # noqa: PLC0415 - only when there is something to say
    from rich.text import Text  # noqa: PLC0415

    said = Text("error: ", style="bold red") + Text(failure.text)
    Console(stderr=True).print(said, soft_wrap=True)


def _application_line(error: Exception) -> str:
    """The application's own last line in an error's traceback, as `file:line: code`, or empty."""
    application = current_options.get().application
    if application is None:
        return ""
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        path = Path(frame.filename)
        if path.is_file() and path.resolve().is_relative_to(application.parent):
            return f"{path.name}:{frame.lineno}: {frame.line}"
    return ""

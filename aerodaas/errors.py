"""The exceptions of the project: one small tree; every message gives a remedy.

`exit_code` is what the command line returns: 2 when the user's input is wrong (usage), 1 when
something failed that the input could not have told.
"""

from __future__ import annotations

import difflib
import os
import traceback

__all__ = [
    "AeroDaaSError",
    "AmbiguousIdError",
    "ClockError",
    "ConfigError",
    "EndpointError",
    "GoesOnError",
    "GraphError",
    "IncompleteError",
    "InvalidWaypointError",
    "MissionError",
    "ModelError",
    "RecordingError",
    "SchedulerError",
    "SilentError",
    "SourceError",
    "UnknownIdError",
    "UnreachableError",
    "VehicleError",
    "failure_line",
]


class AeroDaaSError(Exception):
    """Base of every error raised on purpose by this project."""

    exit_code = 1


class ConfigError(AeroDaaSError):
    """An environment file is missing, malformed or contradicts itself."""

    exit_code = 2


class UnknownIdError(AeroDaaSError):
    """An unknown robot, sensor, compute resource or plug-in was requested."""

    exit_code = 2

    def __init__(self, kind: str, wanted: str, known: list[str]) -> None:
        """Name the `kind` of thing, the one that was `wanted`, and the `known` ones."""
        choices = ", ".join(sorted(known)) or "none"
        # Scoped names are known by their last part, too.
        names = {name: None for one in known for name in (one, one.rpartition("/")[2])}
        close = difflib.get_close_matches(wanted, names, n=1)
        meant = f" (did you mean {close[0]}?)" if close else ""
        super().__init__(f"no {kind} is called {wanted!r}; known: {choices}{meant}")
        self._args = (kind, wanted, known)

    def __reduce__(self) -> tuple[type[UnknownIdError], tuple[str, str, list[str]]]:
        """Pickle by the constructor's own arguments: errors cross process boundaries."""
        return (type(self), self._args)


class AmbiguousIdError(AeroDaaSError):
    """A short name was given that several things bear."""

    exit_code = 2

    def __init__(self, kind: str, wanted: str, fitting: list[str]) -> None:
        """Name the `kind` of thing, the `wanted` name, and the full names of the `fitting` ones."""
        choices = " or ".join(sorted(fitting))
        super().__init__(f"more than one {kind} is called {wanted!r}; say {choices}")
        self._args = (kind, wanted, fitting)

    def __reduce__(self) -> tuple[type[AmbiguousIdError], tuple[str, str, list[str]]]:
        """Pickle by the constructor's own arguments: errors cross process boundaries."""
        return (type(self), self._args)


class GraphError(AeroDaaSError):
    """The dataflow cannot work: wrong type on an edge, missing input, a second navigator."""

    exit_code = 2


class GoesOnError(GraphError):
    """An application that is only built, not flown, wants something of its flight."""


class InvalidWaypointError(AeroDaaSError, ValueError):
    """A waypoint or command holds values that no vehicle could fly."""

    exit_code = 2


class ModelError(AeroDaaSError):
    """A model file cannot be loaded or does not fit the analysis."""

    exit_code = 2


class SchedulerError(AeroDaaSError):
    """A scheduler plug-in cannot be used."""

    exit_code = 2


class SourceError(AeroDaaSError):
    """A camera, folder of images, video or sensor feed cannot be read."""

    exit_code = 2


class UnreachableError(SourceError):
    """A service does not answer."""

    exit_code = 1


class ClockError(AeroDaaSError):
    """Simulated time stopped advancing because a participant no longer answers."""


class VehicleError(AeroDaaSError):
    """A vehicle refused a command, did not connect, or was lost."""


class MissionError(AeroDaaSError):
    """A mission failed in flight; the drone was held, returned or landed before this was raised."""


class SilentError(MissionError):
    """A drone or an actor did not answer in time; it may be busy."""


class IncompleteError(MissionError):
    """A mission ended safely before its plan was flown."""


class EndpointError(AeroDaaSError):
    """An inference endpoint did not answer in time, or not as agreed."""


class RecordingError(AeroDaaSError):
    """A recording cannot be written or read."""

    exit_code = 2


def failure_line(error: BaseException) -> str:
    """One line with an exception's type, message, file and line."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f" at {os.path.basename(frames[-1].filename)}:{frames[-1].lineno}" if frames else ""  # noqa: PTH119
    try:
        said = str(error)
    except Exception:  # noqa: BLE001 - a plug-in's class, whose `__str__` may raise
        said = "it cannot say why"
    return f"{type(error).__name__}: {said}{place}"


def as_project_error(name: str, error: BaseException) -> AeroDaaSError:
    """The error itself if it is the project's; else one that names the part that raised it."""
    if isinstance(error, AeroDaaSError):
        return error
    return AeroDaaSError(f"{name}: {failure_line(error)}")

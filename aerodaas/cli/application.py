"""Running an application's file under options of the command line."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

from aerodaas.config.options import RunOptions, current_options
from aerodaas.types.errors import ConfigError

__all__ = ["run_application", "speed_option"]


def run_application(application: Path, words: list[str], options: RunOptions) -> None:
    """Run `application` with the arguments `words`, as Python itself would; or fly a document.

    Raises ConfigError if there is no such file, and the application's own exceptions.
    """
    if not application.is_file():
        raise ConfigError(f"there is no application {application}")
    if application.suffix == ".json":
        from aerodaas.environment.document.flying import fly_mission  # noqa: PLC0415 - slow to load

        if words:
            raise ConfigError(f"a mission document takes no arguments of its own: {words[0]!r}")
        fly_mission(application, options)
        return
    current_options.set(options)
    sys.argv = [str(application), *words]
    sys.path.insert(0, str(application.resolve().parent))
    runpy.run_path(str(application), run_name="__main__")


def speed_option(text: str | None) -> tuple[float | None, bool | None]:
    """Read `--speed`: the factor, and whether lockstep is wanted; raises ConfigError."""
    if text is None:
        return None, None
    if text == "max":
        return None, True
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not 0.0 < factor < float("inf"):
        raise ConfigError(f'--speed takes a positive number or "max", not {text!r}')
    return factor, False

"""Running an application's file under options of the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from aerodaas.config.options import RunOptions
from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment
    from aerodaas.protocol.schemas import MissionOut

__all__ = [
    "build_application",
    "run_application",
    "runtime_option",
    "speed_option",
    "submit_application",
]


def run_application(application: Path, words: list[str], options: RunOptions) -> None:
    """Run `application` with the arguments `words`, as Python itself would; or fly a document.

    Raises the application's own exceptions.
    """
    if application.suffix == ".json":
        from aerodaas.environment.document.flying import fly_mission  # noqa: PLC0415 - slow to load

        if words:
            raise ConfigError(f"a mission document takes no arguments of its own: {words[0]!r}")
        fly_mission(application, options)
        return
    from aerodaas.environment.offering import run_file  # noqa: PLC0415 - slow to load

    run_file(application, words, options)


def build_application(application: Path, words: list[str], options: RunOptions) -> Environment:
    """Run `application` up to `start_mission()`, or read a document; nothing flies.

    Raises what `run_application` raises, and GraphError if it starts no mission, or several.
    """
    from aerodaas.environment.offering import offered, the_only  # noqa: PLC0415 - slow to load

    with offered() as found:
        run_application(application, words, options)
    environment = the_only(found)
    environment.place_entries()
    return environment


def submit_application(application: Path, words: list[str], options: RunOptions) -> MissionOut:
    """Run `application` up to `start_mission()`, or read a document, and submit what it flies.

    Raises what `run_application` raises, and GraphError for what is code of the application's own.
    """
    from aerodaas.environment.document.compiling import (  # noqa: PLC0415 - slow to load
        compile_mission,
    )
    from aerodaas.environment.provider.submission import submit  # noqa: PLC0415 - as above

    environment = build_application(application, words, options)
    if environment.provider is None:
        raise ConfigError(f"{application} is flown by no provider: name one")
    written = compile_mission(environment, application.stem)
    return submit(environment.provider, written.document, written.models, options)


def runtime_option(text: str | None) -> Literal["inline", "ray"] | None:
    """Read `--runtime`; raises ConfigError for one that there is not."""
    if text is None or text == "inline":
        return text
    if text == "ray":
        return "ray"
    raise ConfigError(f"--runtime is inline or ray, not {text!r}")


def speed_option(text: str | None) -> tuple[float | None, bool | None]:
    """Read `--speed`: the factor, and whether time is simulated; raises ConfigError."""
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

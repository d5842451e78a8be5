"""Options of `aerodaas run`, which override the application's."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from aerodaas.errors import ConfigError

if TYPE_CHECKING:
    from aerodaas.config.model import EnvironmentConfig

__all__ = ["EdgeShare", "LiveViews", "ProviderOptions", "RunOptions", "Speed", "current_options"]

Speed: TypeAlias = "float | Literal['max']"
"""Mission seconds per wall second; `max`: as fast as the machine goes, in simulated time."""


@dataclass(frozen=True)
class ProviderOptions:
    """Options of a submission to a provider; None keeps the service's own default."""

    url: str | None = None
    """Provider's service instead of the application's environment."""
    minutes: float | None = None
    """Of the lease that is requested with a mission."""
    lease: str | None = None
    """A lease that the account has."""
    silence: str | None = None
    """`continue` or `return`: what the drones do when nothing is heard of their user."""
    silence_seconds: float | None = None
    share: tuple[str, ...] = ()
    """Tenants that may watch."""
    attach: str | None = None
    """A flying mission whose cameras are shared: the application senses only."""
    grant: tuple[str, ...] = ()
    """Tenants that may attach missions to its cameras: `TENANT`, or `TENANT=SENSOR,…`."""
    report: Callable[[Any], None] | None = None
    """Told of each mission that has ended, a `MissionOut`."""


@dataclass(frozen=True)
class LiveViews:
    """Live viewers of the recorded streams."""

    foxglove: str | None = None
    """Address (`host:port`) of Foxglove's WebSocket; None for none."""
    others: Mapping[str, Any] = field(default_factory=dict)
    """Place of each view that an extension shows, by the view's name."""


@dataclass(frozen=True)
class EdgeShare:
    """Share of an edge that several flights of a provider use."""

    turns: Path
    """Socket of the service that gives turns."""
    tenant: str
    weight: float = 1.0


@dataclass(frozen=True)
class RunOptions:
    """Options of one run; None keeps the setting of the application or its environment file."""

    environment: Path | None = None
    """Environment file instead of the application's own."""
    senses_only: bool = False
    """Run without a robot that navigates, as long as the cameras have pictures: a mission that is
    attached to another one's cameras."""
    config: EnvironmentConfig | None = None
    """Environment itself, in the place of the file's content; relative paths are the file's."""
    speed: float | None = None
    """Mission seconds per wall second."""
    simulated_time: bool | None = None
    """Simulated time as fast as the machine goes; None: where all robots are simulated."""
    runtime: Literal["inline", "ray"] | None = None
    """Where cameras and analyses run in simulated time: in the application's process, or in actors
    on Ray; None: inline, unless `address` names a cluster."""
    seed: int | None = None
    record: Path | None = None
    """Folder for the recording, the plots and the summary."""
    address: str | None = None
    """Ray cluster to join."""
    edge: EdgeShare | None = None
    """Share the edge with other flights of a provider."""
    locks: Path | None = None
    """Folder of a provider's locks, which the drones' actors hold; None without a provider."""
    overrides: dict[str, Any] = field(default_factory=dict)
    """Settings by `id.setting`, such as `camera.rate`."""
    view: bool = True
    """Show the live terminal view."""
    report: Literal["page", "figures"] | None = "page"
    """What to write beside the recording: the report's page, plots and summary, or only the
    summary as JSON."""
    live: str | None = None
    """Serve Foxglove's WebSocket at this `host:port` while flying."""
    show: tuple[str, ...] = ()
    """Live views of extensions, by name."""
    console: str | None = None
    """Serve the console to browsers at this `host:port` while flying."""
    remote: bool = True
    """Serve the flight to a remote user, if the application uses `RemoteAnalytics`."""
    replay: Path | None = None
    """Recording to be flown again: its environment takes the place of the application's."""
    scheduler: str | None = None
    """Analytics scheduler instead of the application's own."""
    model: Path | None = None
    """ONNX model for every detector, instead of its own."""
    provider: ProviderOptions = field(default_factory=ProviderOptions)
    """For flights on a provider's drones."""
    application: Path | None = None
    """The application's file, for relative paths and the recording's provenance."""

    def at_speed(self, speed: Speed | None) -> RunOptions:
        """These options with an application's `speed`, where the command line names none.

        Raises ConfigError for a speed that is none.
        """
        if speed is None or self.speed is not None or self.simulated_time is not None:
            return self
        if speed == "max":
            return replace(self, simulated_time=True)
        try:
            factor = float(speed)
        except (TypeError, ValueError):
            factor = 0.0
        if not 0.0 < factor < float("inf"):
            raise ConfigError(f'speed is a positive number or "max", not {speed!r}')
        return replace(self, speed=factor, simulated_time=False)

    def beside_application(self, path: Path) -> Path:
        """A relative path beside the application's file, else in the working directory."""
        main = getattr(sys.modules.get("__main__"), "__file__", None)
        application = self.application or (Path(main) if main else None)
        beside = application.parent / path if application is not None else path
        return beside if beside.exists() else path


_CURRENT: ContextVar[RunOptions] = ContextVar("run_options", default=RunOptions())  # noqa: B039 - frozen
current_options = _CURRENT
"""Options of the run under way; the command line sets them, `Environment` reads them."""

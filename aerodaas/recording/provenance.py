"""Provenance of a recording: versions, configuration, application and seed of its run."""

from __future__ import annotations

import hashlib
import platform
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from typing_extensions import Self

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.redaction import public_document

__all__ = ["Provenance", "package_versions", "processor_name", "revision_of"]

_PACKAGES = ("aerodaas", "ray", "numpy", "opencv-python-headless", "onnxruntime", "panda3d")


@dataclass(frozen=True, slots=True)
class Provenance:
    """Versions, configuration, application and seed of a run."""

    started_ns: int = field(default_factory=time.time_ns)
    """Wall time (Unix, nanoseconds) at which the mission clock read zero."""
    name: str = ""
    """Name of the application, for titles."""
    seed: int | None = None
    speed: str = ""
    """`--speed` as given."""
    config: str = ""
    """The environment configuration without its secrets, JSON."""
    app: str = ""
    """File name of the application."""
    app_sha256: str = ""
    """SHA-256 of the application's file, hexadecimal."""
    app_source: str = ""
    """Source of the application, if the environment says that it is recorded."""
    document: str = ""
    """Mission document of the application, JSON; empty for one that no document can hold."""
    revision: str = ""
    """Git commit of the application's repository, with `+` if it had changes; or empty."""
    versions: Mapping[str, str] = field(default_factory=dict)
    """Versions of Python, the platform and the main packages, by name."""

    @classmethod
    def collect(
        cls,
        *,
        app: Path | None = None,
        config: EnvironmentConfig | None = None,
        seed: int | None = None,
        speed: str = "",
        document: str = "",
    ) -> Self:
        """Collect the provenance of a run.

        The configuration's secrets are left out, and the application's source is, unless
        `recording.application_source` asks for it.

        Args:
            app: File of the application; None for none.
            config: Environment of the run; None for none.
            seed: Random seed; None takes the simulation's from `config`.
            speed: `--speed` as given.
            document: Mission document of the application; empty for none.
        """
        content = app.read_bytes() if app else b""
        source = config is not None and config.recording.application_source
        return cls(
            name=app.stem if app else "",
            seed=seed if seed is not None or config is None else config.simulation.seed,
            speed=speed,
            config=public_document(config) if config else "",
            app=app.name if app else "",
            app_sha256=hashlib.sha256(content).hexdigest() if app else "",
            document=document,
            app_source=content.decode("utf-8", "replace") if source else "",
            revision=revision_of(app.parent if app else Path.cwd()),
            versions=package_versions(),
        )

    def as_metadata(self) -> dict[str, str]:
        """The fields that are short texts and the versions, by name."""
        figures = {
            "epoch_ns": str(self.started_ns),
            "name": self.name,
            "seed": "" if self.seed is None else str(self.seed),
            "speed": self.speed,
            "app": self.app,
            "app_sha256": self.app_sha256,
            "revision": self.revision,
        }
        return figures | dict(self.versions)


def package_versions() -> dict[str, str]:
    """Versions of Python, the platform and the main packages, by name."""
    found = {"python": platform.python_version(), "platform": platform.platform()}
    return found | {name: number for name in _PACKAGES if (number := _version(name))}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def processor_name() -> str:
    """Name of the processor; on ARM boards the kernel gives the architecture only."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def revision_of(folder: Path) -> str:
    """Git commit of the repository that holds `folder`, with `+` if it has changes; or empty."""
    # Never a tag's name, and the commit's in full.
    command = ["git", "describe", "--always", "--exclude=*", "--abbrev=40", "--dirty=+"]
    try:
        return subprocess.run(  # noqa: S603 - fixed arguments, whichever git the user has
            command, cwd=folder, capture_output=True, text=True, timeout=5, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""

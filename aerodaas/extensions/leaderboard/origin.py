"""Where a leaderboard's figures come from: versions, machine, day."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from typing_extensions import Self

import aerodaas
from aerodaas.recording.provenance import package_versions, processor_name, revision_of

__all__ = ["Origin"]


@dataclass(frozen=True, slots=True)
class Origin:
    """Versions and machine of a run."""

    made: str
    """Day, ISO 8601, UTC."""
    revision: str
    """Git commit, with `+` if the tree differs from it; empty for an installed package."""
    processor: str
    cores: int
    versions: dict[str, str]
    took: float = 0.0
    """Seconds by the wall clock."""

    @classmethod
    def here(cls) -> Self:
        """That of this process, at its beginning."""
        return cls(
            datetime.now(timezone.utc).date().isoformat(),
            revision_of(Path(aerodaas.__file__).parent),
            processor_name(),
            os.cpu_count() or 1,
            {name: package_versions()[name] for name in ("aerodaas", "python", "numpy")},
        )

    def line(self) -> str:
        """One line for people."""
        versions = ", ".join(f"{name} {number}" for name, number in self.versions.items())
        revision = f", revision {self.revision[:12]}" if self.revision else ""
        if self.revision.endswith("+"):
            revision += " with changes"
        machine = f"{self.cores} cores, {self.processor}"
        return f"{self.made}: {versions}{revision}; {machine}; {self.took:.0f} s"

    def as_json(self) -> dict[str, Any]:
        """All fields."""
        return asdict(self)

"""Picture of a rehearsed flight: its path, its fence, other leases' areas and what was refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.service.rehearsal.findings import OtherArea

__all__ = ["draw"]


def draw(
    recording: Path,
    picture: Path,
    config: EnvironmentConfig,
    *,
    minutes: float,
    others: Sequence[OtherArea] = (),
) -> None:
    """Write a PNG of a rehearsed flight to `picture`; the other arguments are `judge`'s.

    Raises:
        ExtraMissingError: Without the extra `plots`.
        RecordingError: If the recording cannot be read, or the picture cannot be written.
    """
    raise NotImplementedError

"""Verdict of a rehearsed flight, from its recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from aerodaas.config.model import EnvironmentConfig
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.service.rehearsal.findings import OtherArea

__all__ = ["OtherArea", "judge"]


def judge(
    recording: Path,
    config: EnvironmentConfig,
    *,
    minutes: float,
    others: Sequence[OtherArea] = (),
) -> VerdictOut:
    """The verdict of a rehearsed flight.

    Args:
        recording: MCAP file of the flight.
        config: Environment that it flew in.
        minutes: Of the lease.
        others: Areas of all other granted leases.

    Raises:
        RecordingError: If the recording cannot be read.
    """
    raise NotImplementedError

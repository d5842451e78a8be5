"""Verdict of a rehearsed flight, from its recording."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from aerodaas.config.model import EnvironmentConfig
from aerodaas.protocol.schemas import VerdictOut
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight
from aerodaas.service.rehearsal.findings import OtherArea, findings_of, landing_time

__all__ = ["judge"]


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

    Returns:
        Every reason against the flight, with its figures and a remedy; without any it is
        approved. The time is that of the last landing, distance and battery are sums over robots.

    Raises:
        RecordingError: If the recording cannot be read.
        ConfigError: If a robot's fence is invalid.
    """
    with Recording.open(recording) as opened:
        flight, whole = RecordedFlight.read(opened), opened.complete and not opened.damaged
    reasons = [one.text for one in findings_of(flight, config, minutes=minutes, others=others)]
    if not whole:
        reasons.append("the rehearsal's recording breaks off: submit the mission again")
    robots = [robot for robot in flight.robots.values() if robot.bands]
    landings = [end for robot in robots if (end := landing_time(robot)) is not None]
    charges = [robot.battery[np.isfinite(robot.battery)] for robot in robots]
    return VerdictOut(
        approved=not reasons,
        reasons=reasons,
        seconds=max(landings, default=None),
        distance=sum(robot.distance for robot in robots),
        battery_used=float(sum(known[0] - known[-1] for known in charges if len(known))),
    )

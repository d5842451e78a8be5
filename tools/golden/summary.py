"""What a recording says of a flight, as a small JSON object that is equal for equal flights."""

from __future__ import annotations

import hashlib
import json
from collections import Counter, defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from aerodaas.clock import NANOSECONDS
from aerodaas.messages.mission import MissionStatus
from aerodaas.recording.reader import Recording

__all__ = ["differences", "milestones", "summary"]

_SAMPLE = 5 * NANOSECONDS
"""Mission time between two recorded samples of a trajectory."""
_MEASURED = ("aerodaas.Vitals", "aerodaas.Latency")
"""Schemas whose messages tell of the machine, not of the flight."""
_STALLS = ("actor_silent:", "actor_back:")
"""Alerts by the wall clock, of a machine too busy to answer."""
_LOGS = ("/alerts", "/log")
"""Topics whose messages are compared themselves, less stalls."""
_PLANNING = "waiting for a plan"
"""A state that a fast machine may not show."""
_SHARE = 0.1
"""Share of a number, for each metre of tolerance, by which it may differ."""


def summary(path: Path) -> dict[str, Any]:
    """Summarise a recording.

    Args:
        path: An MCAP file.

    Returns:
        Trajectories (a digest of every state, and samples), mission states, alerts, decisions, and
        the number of messages of each topic. Times are seconds of the mission.
    """
    tracks: dict[str, list[list[float]]] = defaultdict(list)
    states: dict[str, list[list[Any]]] = defaultdict(list)
    last: dict[str, MissionStatus] = {}
    decisions: dict[str, list[Any]] = defaultdict(list)
    alerts: list[Any] = []
    counts: Counter[str] = Counter()
    with Recording.open(path) as recording:
        for record in recording.records():
            value, robot = record.value, record.labels.robot
            if record.schema not in _MEASURED and record.topic not in _LOGS:
                counts[record.topic] += 1
            if record.schema == "aerodaas.VehicleState":
                pose = value.odometry
                tracks[robot].append([value.stamp, *pose.position.tolist(), pose.yaw])
            elif record.schema == "aerodaas.MissionStatus":
                told = [value.state.value, value.reason]
                entries = states[robot]
                if not entries or entries[-1][1:] != told:
                    entries.append([_seconds(value.stamp), *told])
                last[robot] = value
            elif record.schema == "aerodaas.Decision":
                row = [value.stamp, value.task, value.action, value.reason]
                decisions[record.topic].append(row)
            elif record.schema == "foxglove.Log" and not value.message.startswith(_STALLS):
                alerts.append([_seconds(record.captured), value.level, value.name, value.message])
    return {
        "trajectories": {robot: _trajectory(rows) for robot, rows in sorted(tracks.items())},
        "states": dict(sorted(states.items())),
        "visited": {robot: list(status.visited) for robot, status in sorted(last.items())},
        "given_up": {robot: list(status.given_up) for robot, status in sorted(last.items())},
        "log": sorted(alerts),
        "decisions": {topic: _decided(rows) for topic, rows in sorted(decisions.items())},
        "counts": dict(sorted(counts.items())),
    }


def milestones(whole: dict[str, Any]) -> dict[str, Any]:
    """The part of a summary in which two flights in real time are alike."""
    return {
        "ends": {robot: track["samples"][-1][:4] for robot, track in whole["trajectories"].items()},
        "states": {
            robot: [state for _, state, reason in entries if reason != _PLANNING]
            for robot, entries in whole["states"].items()
        },
        # Of two places as near as each other, noise decides which comes first.
        "visited": {robot: sorted(names) for robot, names in whole["visited"].items()},
        "given_up": whole["given_up"],
    }


def differences(golden: Any, flown: Any, *, near: float = 0, at: str = "") -> Iterable[str]:  # noqa: ANN401 - JSON
    """Tell where two summaries differ, a line each.

    Args:
        golden: The summary that is kept.
        flown: The summary of a new flight.
        near: Metres within which places are equal; a greater number may differ by 10 % for each
            metre of it, and digests do not count. 0 compares to the last digit.
        at: Path of both within the whole.

    Yields:
        Path, kept value and new value.
    """
    if isinstance(golden, dict) and isinstance(flown, dict):
        for key in sorted(golden.keys() | flown.keys()):
            if key != "digest" or not near:
                yield from differences(golden.get(key), flown.get(key), near=near, at=f"{at}/{key}")
    elif isinstance(golden, list) and isinstance(flown, list) and len(golden) == len(flown):
        for number, (kept, new) in enumerate(zip(golden, flown, strict=True)):
            yield from differences(kept, new, near=near, at=f"{at}/{number}")
    elif near and isinstance(golden, int | float) and isinstance(flown, int | float):
        if abs(golden - flown) > near * max(1, _SHARE * abs(golden)):
            yield f"{at}: {golden} -> {flown}"
    elif golden != flown:
        yield f"{at}: {_short(golden)} -> {_short(flown)}"


def _trajectory(rows: list[list[float]]) -> dict[str, Any]:
    samples, due = [], 0
    for row in rows:
        if row[0] >= due or row is rows[-1]:
            samples.append([_seconds(int(row[0])), *row[1:]])
            due = int(row[0]) + _SAMPLE
    return {"digest": _digest(rows), "samples": samples}


def _decided(rows: list[list[Any]]) -> dict[str, Any]:
    return {
        "digest": _digest(rows),
        "actions": dict(sorted(Counter(row[2] for row in rows).items())),
        "first": rows[0],
        "last": rows[-1],
    }


def _digest(rows: list[list[Any]]) -> str:
    return hashlib.sha256(json.dumps(rows).encode()).hexdigest()[:16]


def _seconds(stamp: int) -> float:
    return round(stamp / NANOSECONDS, 6)


def _short(value: Any) -> str:  # noqa: ANN401 - JSON
    text = json.dumps(value)
    longest = 160
    return text if len(text) <= longest else f"{text[:longest]}…"

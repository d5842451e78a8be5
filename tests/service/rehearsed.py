"""Rehearsals flown in lockstep, for tests of their verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from flying import Flyer, hop, robot

from aerodaas import Environment
from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.service.rehearsal import rehearsal_config
from aerodaas.types.errors import MissionError

__all__ = ["FIELD", "OtherLease", "Rehearsal", "rehearse"]

FIELD: dict[str, Any] = {
    "name": "field",
    "robots": [robot(start=[0, 0, 0])],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}
"""One drone in still air."""


@dataclass(frozen=True)
class OtherLease:
    """Area of another lease."""

    id: str
    area: list[tuple[float, float]]


@dataclass(frozen=True)
class Rehearsal:
    """A flown rehearsal."""

    recording: Path
    config: EnvironmentConfig


def rehearse(
    flyer: Flyer,
    navigation: AeroNavigation | None = None,
    *,
    limits: Mapping[str, Any] | None = None,
    driver: Mapping[str, Any] | None = None,
    battery: float = 1.0,
) -> Rehearsal:
    """Fly `navigation` in the rehearsal of the field, with further `limits`."""
    content = {**FIELD, "robots": [{**FIELD["robots"][0], **(driver or {})}]}
    content["robots"][0]["limits"] = {**FIELD["robots"][0]["limits"], **(limits or {})}
    config = rehearsal_config(validated(content, "the field"), {"drone": battery}, seed=5)

    def build(env: Environment) -> None:
        env.get_robot_by_id("drone").navigate(navigation or hop((6, 0), (6, 6)))

    try:
        run = flyer.fly(build, config.model_dump(mode="json", by_alias=True), seed=5)
    except MissionError:
        return Rehearsal(next(flyer.folder.glob("flight/*.mcap")), config)
    assert run.recording is not None
    return Rehearsal(run.recording, config)

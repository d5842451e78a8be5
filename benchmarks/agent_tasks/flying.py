"""Flights of mission documents in this process, in simulated time, and their evidence."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path

from missions.catalogue import APPS
from missions.evidence import Evidence

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.options import RunOptions, current_options
from aerodaas.config.overrides import overridden
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.environment.document.building import build_mission
from aerodaas.environment.environment import Environment
from aerodaas.errors import MissionError

__all__ = ["fly"]


def fly(
    document: MissionDocument,
    environment: str,
    folder: Path,
    *,
    changes: Mapping[str, object] | None = None,
    seed: int = 0,
) -> Evidence:
    """Fly a document into a folder; a mission that is aborted has evidence, too.

    Args:
        document: The mission.
        environment: Name of one of the applications' environments.
        folder: Empty or new; the recording lies in it.
        changes: Settings laid over the environment, by dotted name.
        seed: Of the simulation.

    Raises:
        AeroDaaSError: If the document cannot be flown here.
    """
    place = APPS / "environments" / f"{environment}.json"
    config = overridden(EnvironmentConfig.load(place), changes or {})
    for robot in config.robots:
        # A camera that nothing reads would be rendered for the recording alone.
        robot.sensors[:] = [one for one in robot.sensors if one.full_id in document.sensors]
    options = RunOptions(
        environment=place,
        config=config,
        simulated_time=True,
        seed=seed,
        record=folder,
        view=False,
        report=None,
    )
    token = current_options.set(options)
    try:
        flown = Environment(place)
        build_mission(document, flown, folder / "models")
        run = flown.launch()
        with contextlib.suppress(MissionError):  # what it ended with is in the recording
            run.wait()
    finally:
        current_options.reset(token)
    (folder / "mission.json").write_text(document.text(), encoding="utf-8")
    return Evidence.read(folder / "flight.mcap")

"""Environment for the replay of a recording, with its hardware played from the file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from aerodaas.config.model import CameraConfig, EnvironmentConfig, validated
from aerodaas.recording.encoding import topic
from aerodaas.recording.reader import Recording
from aerodaas.recording.recorded_environment import allowed_content, merged, recorded_content

__all__ = ["replay_environment"]

_FINITE = frozenset({"folder", "recorded", "video", "mcap"})
"""Camera drivers that may run out of images, which ends a mission that depends on them."""


def replay_environment(path: str | Path, local: str | Path | None = None) -> EnvironmentConfig:
    """Environment of a recording, with vehicles and cameras played from the file.

    Args:
        path: The MCAP file.
        local: Environment file that gives what no recording may bring: plug-ins, packages,
            endpoints, nodes; None for none.

    Returns:
        What may be read of the recorded environment, laid over the local one, with replay
        drivers; recording is enabled without images.

    Raises:
        RecordingError: If the recording cannot be read or was not written by `aerodaas run`.
        ConfigError: If the local file, or what comes of both, is no environment.
    """
    path = Path(path).resolve()
    with Recording.open(path) as recording:
        recorded = allowed_content(recorded_content(recording))
    given: dict[str, Any] = {}
    if local is not None:
        given = EnvironmentConfig.load(local).model_dump(by_alias=True, exclude_unset=True)
    place = f"the environment in {path}"
    config = validated(merged(recorded, given), place)
    content = config.model_dump(by_alias=True)
    for robot in content["robots"]:
        robot["settings"] = {
            "path": str(path),
            "driver": robot["driver"],
            "settings": robot["settings"],
        }
        robot["driver"] = "replayed"
        for sensor in robot["sensors"]:
            _play(sensor, f"{robot['id']}/{sensor['id']}", path)
    for sensor in content["sensors"]:
        _play(sensor, sensor["id"], path)
    content["recording"] |= {"enabled": True, "path": None, "images": "none"}
    return validated(content, place)


def _play(sensor: dict[str, Any], stream: str, path: Path) -> None:
    if sensor["type"] != "camera":
        return
    lens = {key: it for key, it in sensor["settings"].items() if key in CameraConfig.model_fields}
    endless = sensor["driver"] not in _FINITE or lens.get("loop", False)
    played = {"path": str(path), "topic": topic(stream, "image"), "loop": endless}
    sensor["settings"] = lens | played
    sensor["driver"] = "replayed"

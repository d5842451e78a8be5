"""Environment for the replay of a recording, with its hardware played from the file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from aerodaas.config.model import CameraConfig, EnvironmentConfig, validated
from aerodaas.recording.encoding import topic
from aerodaas.recording.reader import Recording
from aerodaas.types.errors import RecordingError

__all__ = ["replay_environment"]

_FINITE = frozenset({"folder", "recorded", "video", "mcap"})
"""Camera drivers that may run out of images, which ends a mission that depends on them."""


def replay_environment(path: str | Path) -> EnvironmentConfig:
    """Environment of a recording, with vehicles and cameras played from the file.

    Args:
        path: The MCAP file.

    Returns:
        The recorded environment with replay drivers; recording is enabled without images.

    Raises:
        RecordingError: If the recording cannot be read or was not written by `aerodaas run`.
    """
    path = Path(path).resolve()
    with Recording.open(path) as recording:
        if "environment.json" not in recording.attachments:
            raise RecordingError(
                f"{path} holds no environment, so no run of ours has written it; to fly by its "
                'pictures, name it as the "path" of a camera with the driver "mcap"'
            )
        content = json.loads(recording.attachment("environment.json"))
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
    return validated(content, f"the environment in {path}")


def _play(sensor: dict[str, Any], stream: str, path: Path) -> None:
    if sensor["type"] != "camera":
        return
    lens = {key: it for key, it in sensor["settings"].items() if key in CameraConfig.model_fields}
    endless = sensor["driver"] not in _FINITE or lens.get("loop", False)
    played = {"path": str(path), "topic": topic(stream, "image"), "loop": endless}
    sensor["settings"] = lens | played
    sensor["driver"] = "replayed"

"""An environment file to begin with, from a vehicle, its address and its cameras."""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from aerodaas.errors import ConfigError, UnknownIdError

__all__ = ["VEHICLES", "EnvironmentChoices", "camera_words", "default_address"]

VEHICLES = ("simulated", "px4", "ardupilot", "tello")

_ADDRESSES = {
    "px4": "udpin:127.0.0.1:14540",
    "ardupilot": "udpin:127.0.0.1:14550",
    "tello": "192.168.10.1",
}
_DRIVERS = {"px4": "mavlink", "ardupilot": "mavlink"}
_LIMITS: dict[str, dict[str, Any]] = {
    "simulated": {"cruise_speed": 2.0},
    "px4": {"takeoff_height": 3.0, "cruise_speed": 2.0},
    "ardupilot": {"takeoff_height": 3.0, "cruise_speed": 2.0},
    "tello": {"takeoff_height": 1.2, "cruise_speed": 0.4, "max_speed": 1.0},
}
_FENCES = {"simulated": (20, 10), "px4": (20, 10), "ardupilot": (20, 10), "tello": (5, 3)}
"""Metres from the take-off to each side, and up: room for a first flight, to be widened."""
_NONE = "none"


def default_address(vehicle: str) -> str | None:
    """Where a vehicle is by default; None for a simulated one."""
    return _ADDRESSES.get(vehicle)


def camera_words(vehicle: str) -> tuple[str, ...]:
    """The cameras that such a vehicle brings along."""
    return (vehicle,) if vehicle in {"simulated", "tello"} else ()


@dataclass(frozen=True)
class EnvironmentChoices:
    """Choices from which an environment file is written."""

    vehicle: str
    """One of `VEHICLES`."""
    address: str | None = None
    """MAVLink URL, or a Tello's address; None: the vehicle's default."""
    system: int | None = None
    """MAVLink system id, where several are heard."""
    cameras: Sequence[str] | None = None
    """`simulated`, `tello`, a device, a URL, a file or a folder; `none` is none. None: those that
    the vehicle brings along."""
    compute: Sequence[dict[str, str]] = field(default=({"id": "edge", "kind": "edge"},))

    def document(self, schema: str, folder: Path) -> dict[str, Any]:
        """The content of an environment file.

        Args:
            schema: Its `$schema`.
            folder: Folder of the file.

        Raises:
            UnknownIdError: For an unknown vehicle.
            ConfigError: For an address or a camera that it cannot have.
        """
        if self.vehicle not in VEHICLES:
            raise UnknownIdError("vehicle", self.vehicle, list(VEHICLES))
        side, ceiling = _FENCES[self.vehicle]
        fence = {
            "polygon": [[-side, -side], [side, -side], [side, side], [-side, side]],
            "floor": 0.3,
            "ceiling": ceiling,
        }
        sensors = [
            *self._cameras(folder),
            {"id": "odometry", "type": "odometry", "rate": 10},
            {"id": "battery", "type": "battery", "rate": 1},
        ]
        robot = {
            "id": "drone",
            "driver": _DRIVERS.get(self.vehicle, self.vehicle),
            "settings": self._settings(),
            "limits": {**_LIMITS[self.vehicle], "geofence": fence},
            "sensors": sensors,
        }
        if not robot["settings"]:
            del robot["settings"]
        world = {"world": "field", "wind": [0.5, 0.3, 0.0], "gust": 0.3}
        return {
            "$schema": schema,
            "name": self.vehicle,
            "robots": [robot],
            "compute": list(self.compute),
            "schedulers": {"trajectory": "nearest_neighbor"},
            **({"simulation": world} if self.vehicle == "simulated" else {}),
        }

    def _settings(self) -> dict[str, Any]:
        address = self.address or default_address(self.vehicle)
        if self.vehicle == "simulated":
            if self.address is not None:
                raise ConfigError("a simulated drone has no address: name a vehicle that has one")
            return {}
        if self.vehicle == "tello":
            return {"address": address}
        system = {} if self.system is None else {"system": self.system}
        return {"url": address, **system}

    def _cameras(self, folder: Path) -> list[dict[str, Any]]:
        words = camera_words(self.vehicle) if self.cameras is None else self.cameras
        wanted = [word for word in words if word != _NONE]
        if len(wanted) != len(words) and wanted:
            raise ConfigError(f"--camera {_NONE} goes with no other camera")
        names = ["camera", *(f"camera{number}" for number in range(2, len(wanted) + 1))]
        return [
            self._camera(name, word, folder)
            for name, word in zip(names[: len(wanted)], wanted, strict=True)
        ]

    def _camera(self, name: str, word: str, folder: Path) -> dict[str, Any]:
        sensor: dict[str, Any] = {"id": name, "type": "camera", "rate": 10}
        if word in {"simulated", "tello"}:
            if word != self.vehicle:
                raise ConfigError(
                    f"a camera of the kind {word!r} is a {word} drone's own, not a "
                    f"{self.vehicle} one's: give a device, a URL, a file or a folder"
                )
            settings = {"width": 640, "height": 360, "pitch": 30} if word == "simulated" else {}
            return {**sensor, **({"settings": settings} if settings else {})}
        is_device = word.startswith("/dev/") or "://" in word
        if not is_device and not Path(word).exists():
            raise ConfigError(
                f"no camera {word!r}: a device such as /dev/video0, a URL such as rtsp://…, or a "
                f"file or folder that exists; {' or '.join((*camera_words(self.vehicle), _NONE))}"
            )
        if is_device:
            return {**sensor, "driver": "video", "settings": {"path": word}}
        # The path is looked up beside the file, wherever that is.
        path = word if Path(word).is_absolute() else os.path.relpath(word, folder)
        return {**sensor, "driver": "recorded", "settings": {"path": path, "loop": True}}

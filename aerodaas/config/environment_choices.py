"""An environment file to begin with, from a vehicle, its address and its cameras."""

from __future__ import annotations

import os.path
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from aerodaas.config.extensions import VehicleKind, extensions
from aerodaas.errors import ConfigError, UnknownIdError

__all__ = ["EnvironmentChoices", "camera_words", "default_address", "vehicle_kinds"]

_AUTOPILOT: dict[str, Any] = {
    "driver": "mavlink",
    "limits": {"takeoff_height": 3.0, "cruise_speed": 2.0},
    "fence": (20, 10),
    "address_setting": "url",
}
_CORE = (
    VehicleKind(
        "simulated",
        driver="simulated",
        limits={"cruise_speed": 2.0},
        fence=(20, 10),
        camera={"width": 640, "height": 360, "pitch": 30},
    ),
    VehicleKind("px4", address="udpin:127.0.0.1:14540", **_AUTOPILOT),
    VehicleKind("ardupilot", address="udpin:127.0.0.1:14550", **_AUTOPILOT),
)
_NONE = "none"


def vehicle_kinds() -> dict[str, VehicleKind]:
    """Kinds of vehicles that an environment file can begin with, by name."""
    added = (kind for extension in extensions().values() for kind in extension.vehicles)
    return {kind.name: kind for kind in (*_CORE, *added)}


def default_address(vehicle: str) -> str | None:
    """Where a vehicle is by default; None for one without an address or of an unknown kind."""
    kind = vehicle_kinds().get(vehicle)
    return kind.address if kind else None


def camera_words(vehicle: str) -> tuple[str, ...]:
    """The cameras that such a vehicle brings along."""
    kind = vehicle_kinds().get(vehicle)
    return (vehicle,) if kind and kind.camera is not None else ()


@dataclass(frozen=True)
class EnvironmentChoices:
    """Choices from which an environment file is written."""

    vehicle: str
    """Name of one of the `vehicle_kinds()`."""
    address: str | None = None
    """MAVLink URL, or network address; None: the vehicle's default."""
    system: int | None = None
    """MAVLink system id, where several are heard."""
    cameras: Sequence[str] | None = None
    """The vehicle's own by its name, a device, a URL, a file or a folder; `none` is none. None:
    those that the vehicle brings along."""

    def document(self, schema: str, folder: Path) -> dict[str, Any]:
        """The content of an environment file.

        Args:
            schema: Its `$schema`.
            folder: Folder of the file.

        Raises:
            UnknownIdError: For an unknown vehicle.
            ConfigError: For an address or a camera that it cannot have.
        """
        kinds = vehicle_kinds()
        if self.vehicle not in kinds:
            raise UnknownIdError("vehicle", self.vehicle, list(kinds))
        kind = kinds[self.vehicle]
        side, ceiling = kind.fence
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
            "driver": kind.driver,
            "settings": self._settings(kind),
            "limits": {**kind.limits, "geofence": fence},
            "sensors": sensors,
        }
        if not robot["settings"]:
            del robot["settings"]
        world = {"world": "field", "wind": [0.5, 0.3, 0.0], "gust": 0.3}
        return {
            "$schema": schema,
            "name": self.vehicle,
            "robots": [robot],
            "compute": [{"id": "edge", "kind": "edge"}],
            "schedulers": {"trajectory": "nearest_neighbor"},
            **({"simulation": world} if self.vehicle == "simulated" else {}),
        }

    def _settings(self, kind: VehicleKind) -> dict[str, Any]:
        if not kind.address_setting:
            if self.address is not None:
                raise ConfigError(
                    f"a {kind.name} drone has no address: name a vehicle that has one"
                )
            return {}
        system = {} if self.system is None else {"system": self.system}
        return {kind.address_setting: self.address or kind.address, **system}

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
        own = vehicle_kinds().get(word)
        if own is not None and own.camera is not None:
            if word != self.vehicle:
                raise ConfigError(
                    f"a camera of the kind {word!r} is a {word} drone's own, not a "
                    f"{self.vehicle} one's: give a device, a URL, a file or a folder"
                )
            return {**sensor, **({"settings": dict(own.camera)} if own.camera else {})}
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

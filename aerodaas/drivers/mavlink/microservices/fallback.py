"""Fallback: the vehicle comes home by itself once our process is gone, whatever ended it.

A drone's actor that is killed, or whose host dies, can bring nobody home any more. What is left is
the autopilot, which acts on our silence as its parameters say. They belong to the vehicle's owner:
they are read and judged, and set only where the environment's settings ask for it; what was there
before is kept in a backup before anything is changed, and put back when we let go of the vehicle
on the ground, or the next time, if we were killed.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot, FallbackParameter
from aerodaas.drivers.mavlink.microservices.parameters import Parameters
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.link import MavlinkLink
from aerodaas.errors import VehicleError
from aerodaas.files.private_file import write_private
from aerodaas.files.user_folders import state_folder

__all__ = ["Changes", "Fallback", "ParameterBackup", "ParameterChange"]


class ParameterChange(NamedTuple):
    """A parameter that was set."""

    before: float
    set_to: float


class Changes(BaseModel):
    """Changes of parameters on one vehicle."""

    model_config = ConfigDict(extra="ignore")

    parameters: dict[str, ParameterChange] = Field(default_factory=dict)
    """In the order in which they were set."""


class ParameterBackup:
    """Backup of one vehicle, a file that only its owner can read."""

    def __init__(self, vehicle: str) -> None:
        """Open nothing; `vehicle` names the vehicle and nothing else."""
        self.path = state_folder() / "vehicles" / f"{vehicle}.json"

    def read(self) -> Changes | None:
        """Changes that are still to be restored; None if there are none. Raises VehicleError."""
        try:
            content = self.path.read_text(encoding="utf-8")
        except FileNotFoundError:
            return None
        except (OSError, UnicodeDecodeError) as error:
            raise VehicleError(f"cannot read {self.path}: {error}") from None
        try:
            return Changes.model_validate_json(content)
        except ValidationError:
            raise VehicleError(
                f"{self.path} should say what was changed on this vehicle, and cannot be read: "
                "compare its parameters with your own, then remove the file"
            ) from None

    def write(self, changes: Changes) -> None:
        """Replace it; raises VehicleError."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            write_private(self.path, changes.model_dump_json(indent=1))
        except OSError as error:
            raise VehicleError(
                f"cannot keep in {self.path} what is changed on the vehicle, so nothing is: "
                f"{error}; name a folder that can be written by XDG_STATE_HOME"
            ) from None

    def clear(self) -> None:
        """Remove it: everything was put back."""
        self.path.unlink(missing_ok=True)


_log = logging.getLogger(__name__)

_TOLERANCE = 1e-4
"""By which a single-precision value may differ from itself."""


@dataclass(frozen=True)
class _Judged:
    """A parameter that keeps the vehicle from coming home."""

    wanted: FallbackParameter
    name: str
    value: float | None
    """None: the vehicle did not tell it."""
    needed: float

    @property
    def text(self) -> str:
        """One sentence, with the value to be set."""
        if self.value is None:
            return f"it does not tell {self.name}, so that nobody knows whether it comes home"
        return (
            f"{self.name} is {self.value:g}, so that {self.wanted.why}; it would have to be "
            f"{self.needed:g}"
        )


class Fallback:
    """Fallback of one connection; blocks, and is not for use in the link's thread."""

    def __init__(
        self,
        link: MavlinkLink,
        autopilot: Autopilot,
        settings: MavlinkSettings,
        *,
        name: str,
        backup: ParameterBackup,
    ) -> None:
        """Of robot `name`; nothing is read or changed yet."""
        self._link = link
        self._autopilot = autopilot
        self._settings = settings
        self._name = name
        self._backup = backup
        self.obstacles: tuple[str, ...] = ("its fallback was not looked at: it was flying already",)
        """Why it would not come home, one sentence each; empty if it would."""

    def under(self, settings: MavlinkSettings) -> Fallback:
        """The fallback of the same vehicle under other settings."""
        return Fallback(self._link, self._autopilot, settings, name=self._name, backup=self._backup)

    @property
    def objections(self) -> list[str]:
        """Reasons against a take-off, where the settings ask for a fallback."""
        if self._settings.fallback not in {"require", "set"}:
            return []
        return [f"it would not come home without us: {one}" for one in self.obstacles]

    def establish(self, ceiling: float, software: str) -> None:
        """Judge what it would do, and make it come home where the settings ask for that.

        An observer changes nothing: what is judged then is what a flight could not change.

        Args:
            ceiling: Ceiling of the geofence, metres above home.
            software: Version of the autopilot; empty where it is not known.

        Raises:
            VehicleError: If it cannot be done; what was changed before has been put back.
        """
        self._remind()
        if self._settings.fallback == "set" and self._settings.observe:
            self.obstacles = tuple(self._unsettable(ceiling, software))
            return
        if self._settings.fallback == "set":
            if unable := self._unable():
                raise VehicleError(f"{self._name}: {unable}")
            self._change(self._autopilot.fallback(self._settings, ceiling, software))
        self.obstacles = tuple(self.examine(ceiling, software))
        if self.obstacles and self._settings.fallback == "set":
            raise VehicleError(f"{self._name}: {'; '.join(self.objections)}{self._undone()}")
        if self.obstacles:
            _log.warning(
                '%s: %s would not come home if this process died: %s ("fallback": "set" does it '
                "for a flight)",
                self._name,
                self._autopilot.name,
                "; ".join(self.obstacles),
            )

    def examine(self, ceiling: float, software: str) -> list[str]:
        """Faults that keep the vehicle from coming home, one sentence each; nothing is changed.

        Args:
            ceiling: Ceiling of the geofence, metres above home.
            software: Version of the autopilot; empty where it is not known.
        """
        wanted = self._autopilot.fallback(self._settings, ceiling, software)
        obstacles = [unable] if (unable := self._unable()) else []
        return obstacles + [one.text for one in self._judge(wanted)]

    def restore(self) -> None:
        """Put back what was changed, by this process or an earlier one; raises VehicleError.

        What somebody else has changed since is left alone.
        """
        changes = self._backup.read()
        if changes is None:
            return
        parameters = Parameters(self._link, self._autopilot)
        for name, change in reversed(changes.parameters.items()):
            value = parameters.get(name)
            if value is None:
                raise VehicleError(
                    f"{self._name}: it does not tell {name}, which was {change.before:g} before we "
                    f"set it: {self._backup.path} keeps what is to be put back"
                )
            if _same(value, change.set_to):
                parameters.set(name, change.before)
                _log.warning("%s: %s is %g again", self._name, name, change.before)
            elif not _same(value, change.before):
                _log.warning(
                    "%s: %s is left at %g: somebody else has set it", self._name, name, value
                )
        self._backup.clear()

    def _remind(self) -> None:
        changes = self._backup.read()
        if changes is None or self._settings.fallback == "set":
            return
        said = ", ".join(f"{name} {one.before:g}" for name, one in changes.parameters.items())
        _log.warning(
            "%s: an earlier flight has not put back what was on the vehicle (%s): "
            "`python -m aerodaas.drivers.mavlink URL --restore` does",
            self._name,
            said,
        )

    def _unable(self) -> str:
        """Why its firmware cannot fly the way home that is asked for; empty if it can."""
        if self._settings.way_home in self._autopilot.ways_home:
            return ""
        name = self._autopilot.name
        return f'{name} cannot fly this settings.way_home by itself; take "return"'

    def _unsettable(self, ceiling: float, software: str) -> list[str]:
        """Faults that remain even after all parameters that can be set are set."""
        if unable := self._unable():
            return [unable]
        judged = self._judge(self._autopilot.fallback(self._settings, ceiling, software))
        return [one.text for one in judged if one.value is None]

    def _change(self, wanted: Sequence[FallbackParameter]) -> None:
        """Set what does not fit; the backup is always ahead of the vehicle."""
        judged = self._judge(wanted)
        unknown = [one.text for one in judged if one.value is None]
        if unknown:
            raise VehicleError(f"{self._name}: {'; '.join(unknown)}")
        changes = self._backup.read() or Changes()
        try:
            parameters = Parameters(self._link, self._autopilot)
            for one in judged:
                assert one.value is not None  # noqa: S101 - just asked
                earlier = changes.parameters.pop(one.name, None)
                ours = earlier is not None and _same(earlier.set_to, one.value)
                before = earlier.before if earlier is not None and ours else one.value
                changes.parameters[one.name] = ParameterChange(before, one.needed)
                self._backup.write(changes)
                parameters.set(one.name, one.needed)
                _log.warning(
                    "%s: %s is %g for this flight, instead of %g: %s",
                    self._name,
                    one.name,
                    one.needed,
                    one.value,
                    one.wanted.why,
                )
        except VehicleError as error:
            raise VehicleError(f"{self._name}: no fallback: {error}{self._undone()}") from None

    def _undone(self) -> str:
        """Put back what was changed, after a failure; what people are told of it."""
        try:
            self.restore()
        except VehicleError as error:
            return f"; and what was changed is not put back yet: {error}"
        return ""

    def _judge(self, wanted: Sequence[FallbackParameter]) -> list[_Judged]:
        """Parameters that keep it from coming home."""
        parameters = Parameters(self._link, self._autopilot)
        held = parameters.known(one.names for one in wanted if not one.beside)
        some = [one.names for one in wanted if one.beside in held]
        held |= parameters.known(some, tries=2)
        judged = []
        for one in wanted:
            scales = dict(zip(one.names, one.scales, strict=False))
            name = next((name for name in one.names if name in held), None)
            if name is not None and not one.fits(held[name] / scales[name]):
                needed = int(held[name]) | int(one.value) if one.bits else scales[name] * one.value
                judged.append(_Judged(one, name, held[name], needed))
            elif name is None and not one.beside:
                judged.append(_Judged(one, one.names[0], None, one.value))
        return judged


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= _TOLERANCE * max(1.0, abs(other))

"""Finding the vehicle among all senders on a link, with the reason if there is none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from aerodaas.drivers.mavlink.autopilots.ardupilot import ArduPilot
from aerodaas.drivers.mavlink.autopilots.autopilot import Autopilot
from aerodaas.drivers.mavlink.autopilots.px4 import PX4
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.framing import signed
from aerodaas.drivers.mavlink.wire.link import LinkCounts
from aerodaas.drivers.pin import Peer

__all__ = ["Finder", "FoundVehicle"]

_FAMILIES: tuple[type[Autopilot], ...] = (PX4, ArduPilot)
_MULTICOPTERS = {
    mavlink.MAV_TYPE_QUADROTOR,
    mavlink.MAV_TYPE_COAXIAL,
    mavlink.MAV_TYPE_HELICOPTER,
    mavlink.MAV_TYPE_HEXAROTOR,
    mavlink.MAV_TYPE_OCTOROTOR,
    mavlink.MAV_TYPE_TRICOPTER,
    mavlink.MAV_TYPE_DODECAROTOR,
}
_MOST = 64
"""Systems and components remembered."""


@dataclass(frozen=True)
class FoundVehicle:
    """A vehicle that can be flown."""

    system: int
    component: int
    autopilot: Autopilot
    peer: Peer = None
    """Where its HEARTBEAT came from."""
    signs: bool = False
    """Whether its HEARTBEAT was signed."""


class Finder:
    """Finder that processes HEARTBEATs until one is the vehicle's."""

    def __init__(self, settings: MavlinkSettings) -> None:
        self._settings = settings
        self._others: dict[tuple[int, int], str] = {}
        self.found: FoundVehicle | None = None

    def on_heartbeat(self, message: Any, peer: Peer = None) -> None:  # noqa: ANN401 - pymavlink has no types
        """Process a HEARTBEAT of any sender.

        Args:
            message: The message.
            peer: Address that it came from; None on a wire without addresses.
        """
        system, component = message.get_srcSystem(), message.get_srcComponent()
        objection, family = self._judge(message, system)
        if family is not None and not objection:
            signs = signed(message.get_msgbuf() or b"\0")
            self.found = self.found or FoundVehicle(system, component, family(), peer, signs)
        elif len(self._others) < _MOST:
            self._others[system, component] = objection

    def _judge(self, message: Any, system: int) -> tuple[str, type[Autopilot] | None]:  # noqa: ANN401
        kind = _name("MAV_TYPE", message.type)
        if message.type not in _MULTICOPTERS:
            return f"a {kind}, which is no multicopter", None
        family = next((one for one in _FAMILIES if one.family == message.autopilot), None)
        if family is None:
            maker = _name("MAV_AUTOPILOT", message.autopilot)
            return f"a {kind} with the autopilot {maker}, which is neither PX4 nor ArduPilot", None
        if self._settings.system not in {None, system}:
            return f"a {kind} that would fit", None
        return "", family

    def explain(self, counts: LinkCounts) -> str:
        """Reason why no vehicle was found."""
        url, wanted = self._settings.url, self._settings.system
        if self._others:
            heard = "; ".join(f"system {one[0]}: {text}" for one, text in self._others.items())
            hint = f'; "system" is set to {wanted}' if wanted is not None else ""
            return f"no vehicle on {url}, but {heard}{hint}"
        if counts.damaged:
            key = "; is the signing key the vehicle's?" if counts.refused else ""
            return (
                f"packets come on {url}, but none that can be read{key} "
                "(signed while we have no key, another speed of the line, no MAVLink?)"
            )
        return (
            f"no HEARTBEAT on {url}; is the autopilot switched on, does it send to this host and "
            "port, and is the firewall open?"
        )


def _name(group: str, number: int) -> str:
    entry = mavlink.enums[group].get(number)
    if entry is None:
        return f"{group} {number}"
    return str(entry.name).removeprefix(f"{group}_").replace("_", " ").lower()

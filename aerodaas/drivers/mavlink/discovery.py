"""Discovery of MAVLink vehicles by listening alone: nothing is sent to a vehicle."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

from aerodaas.config.secrets import MAVLINK_KEY
from aerodaas.drivers.mavlink.settings import MavlinkSettings
from aerodaas.drivers.mavlink.wire.dialect import decoded, mavlink
from aerodaas.drivers.mavlink.wire.finder import Finder, FoundVehicle
from aerodaas.drivers.mavlink.wire.framing import Framer
from aerodaas.drivers.mavlink.wire.link import LinkCounts
from aerodaas.drivers.mavlink.wire.transport import Transport, open_transport
from aerodaas.drivers.pin import Peer
from aerodaas.drivers.waiting import wait_readable
from aerodaas.errors import VehicleError

__all__ = ["LISTENED", "HeardVehicle", "MavlinkDiscovery", "hear_vehicles"]

LISTENED = ("udpin:0.0.0.0:14540", "udpin:0.0.0.0:14550", "tcp:127.0.0.1:5760")
"""Where an autopilot is heard by default: PX4's offboard port, the ground station's, and the first
serial port of ArduPilot's simulator, which is this machine's own."""
_WANTED = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT})
_MOST_PEERS = 64
_TICK = 0.05


@dataclass(frozen=True)
class HeardVehicle:
    """A multicopter whose HEARTBEAT was heard."""

    family: str
    """`px4` or `ardupilot`."""
    url: str
    """At which a driver hears it; loopback where it speaks from this machine."""
    system: int
    signs: bool = False
    """Whether it signs what it sends, and so obeys nobody without its key."""

    @property
    def text(self) -> str:
        """One line for people."""
        signs = f"; it signs: to be flown it wants its key, by {MAVLINK_KEY} or signing_key"
        return (
            f"{self.family}, system {self.system}, heard at {self.url}{signs if self.signs else ''}"
        )


@dataclass(frozen=True)
class MavlinkDiscovery:
    """Vehicles that were heard, and notes on why others were not."""

    vehicles: tuple[HeardVehicle, ...] = ()
    notes: tuple[str, ...] = ()
    """Ports that could not be opened, and senders that are no vehicle of ours."""


def hear_vehicles(seconds: float, urls: Sequence[str] = LISTENED) -> MavlinkDiscovery:
    """Listen for HEARTBEATs, which vehicles send once a second.

    Nothing is sent but what opens a TCP connection, by default to this machine alone.

    Args:
        seconds: How long; at least 1.2 to hear each.
        urls: Where, as the setting `url` of a MAVLink vehicle.

    Raises:
        ConfigError: For a URL that is none.
    """
    notes: list[str] = []
    ears: list[_Ear] = []
    with contextlib.ExitStack() as opened:
        for url in urls:
            try:
                wire = open_transport(url, "discovery")
            except VehicleError as error:
                # That no program listens on TCP is the ordinary case, and no news.
                if not url.startswith("tcp:"):
                    notes.append(str(error).removeprefix("discovery: "))
                continue
            opened.callback(wire.close)
            ears.append(_Ear(url, wire))
        until = time.monotonic() + seconds
        while ears and (left := until - time.monotonic()) > 0:
            wait_readable([ear.wire.fileno() for ear in ears], min(left, _TICK))
            for ear in ears:
                ear.receive()
    vehicles = dict.fromkeys(vehicle for ear in ears for vehicle in ear.vehicles())
    return MavlinkDiscovery(
        tuple(vehicles), (*notes, *(note for ear in ears for note in ear.notes()))
    )


@dataclass
class _Ear:
    """One wire, and the senders on it."""

    url: str
    wire: Transport
    framers: dict[Peer, Framer] = field(default_factory=dict)
    finders: dict[tuple[Peer, int], Finder] = field(default_factory=dict)

    def receive(self) -> None:
        """Process what has arrived."""
        for content, peer in self.wire.receive():
            if peer not in self.framers:
                if len(self.framers) >= _MOST_PEERS:
                    continue
                reader = mavlink.MAVLink(None)
                self.framers[peer] = Framer(_WANTED, partial(decoded, reader))
            framer = self.framers[peer]
            for message in framer.feed(content):
                system: int = message.get_srcSystem()  # type: ignore[attr-defined]
                settings = MavlinkSettings(url=self.url)
                self.finders.setdefault((peer, system), Finder(settings)).on_heartbeat(
                    message, peer
                )
            if peer is not None:
                framer.flush()

    def vehicles(self) -> Iterator[HeardVehicle]:
        """Vehicles that can be flown, in the order in which they were heard."""
        for found in (finder.found for finder in self.finders.values()):
            if found is not None:
                yield HeardVehicle(
                    found.autopilot.name.lower(), self._near(found), found.system, found.signs
                )

    def notes(self) -> Iterator[str]:
        """Why others cannot."""
        damaged = sum(framer.damaged for framer in self.framers.values())
        for finder in self.finders.values():
            if finder.found is None:
                yield finder.explain(LinkCounts())
        if damaged and not self.finders:
            yield Finder(MavlinkSettings(url=self.url)).explain(LinkCounts(damaged=damaged))

    def _near(self, found: FoundVehicle) -> str:
        """The address to listen at: this machine's own where the sender is on it."""
        if found.peer is not None and found.peer[0].startswith("127."):
            return self.url.replace("0.0.0.0", "127.0.0.1")  # noqa: S104 - taken out
        return self.url

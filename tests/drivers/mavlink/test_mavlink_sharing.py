"""One wire for the vehicles of one process: what each hears, and what it is spared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from autopilot import Wire
from emulated import FAMILIES, LOOPBACK, Flight, Stepped, inject
from waiting import until

from aerodaas.drivers.mavlink.wire.dialect import mavlink
from aerodaas.drivers.mavlink.wire.senders import SenderPins
from aerodaas.drivers.mavlink.wire.sharing import WireShare, share_wire
from aerodaas.drivers.pin import Peer
from aerodaas.errors import VehicleError
from aerodaas.messages.vehicle import VehicleMode
from tools.mavlink_vehicle import AutopilotOptions

HERE: Peer = (LOOPBACK, 4)
ELSEWHERE: Peer = (LOOPBACK, 5)


class Shared:
    """Shares of a wire by system id."""

    def __init__(self, *systems: int, hears_all: int | None = None) -> None:
        self.wires: list[Wire] = []
        self.shares = [self.share(one, hears_all=one == hears_all) for one in systems]

    def open(self, _url: str, _name: str) -> Wire:
        """A fresh wire."""
        self.wires.append(Wire())
        return self.wires[-1]

    def share(self, system: int, *, hears_all: bool = False) -> WireShare:
        """A share of the vehicle `system`."""
        name = f"robot{system}"
        member: Any = SimpleNamespace(pins=SenderPins(lambda: True), key=None)
        return share_wire(f"test:{id(self)}", name, system, member, self.open, hears_all=hears_all)

    def hear(self, *arrived: tuple[bytes, Peer]) -> list[list[tuple[bytes, Peer]]]:
        """What each share gets of what arrives, all of it."""
        wire = self.wires[-1]
        wire.inbox = [*arrived, (packet(99), HERE)]
        got: list[list[tuple[bytes, Peer]]] = [[] for _ in self.shares]

        def all_here() -> bool:
            for share, mine in zip(self.shares, got, strict=True):
                mine.extend(share.receive())
            return all(mine and mine[-1] == (packet(99), HERE) for mine in got)

        until(all_here)
        return [mine[:-1] for mine in got]

    def close(self) -> None:
        """Give all shares back."""
        for share in self.shares:
            share.close()


@contextmanager
def shared(*systems: int, hears_all: int | None = None) -> Iterator[Shared]:
    """Shares, given back in the end."""
    one = Shared(*systems, hears_all=hears_all)
    try:
        yield one
    finally:
        one.close()


def packet(system: int, component: int = 1) -> bytes:
    """A HEARTBEAT of a system."""
    beat = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)
    return bytes(beat.pack(mavlink.MAVLink(None, system, component)))


def test_the_wire_is_opened_once_and_closed_with_the_last_share() -> None:
    """And opened anew after that."""
    with shared(1, 2) as both:
        assert len(both.wires) == 1
        both.shares[0].close()
        assert both.wires[0].closed == 0
        both.shares[1].close()
        assert both.wires[0].closed == 1
        both.share(1).close()
        assert len(both.wires) == 2


def test_each_hears_its_vehicle_and_those_that_are_nobodys() -> None:
    """A ground station and a radio are everybody's; what is no packet is, too."""
    with shared(1, 2) as both:
        first, second, station = (packet(one) for one in (1, 2, 255))
        mixed = first + second
        one, two = both.hear(
            (first, HERE), (second, HERE), (station, ELSEWHERE), (mixed, HERE), (b"noise", HERE)
        )
        common = [(station, ELSEWHERE), (mixed, HERE), (b"noise", HERE)]
        assert one == [(first, HERE), *common]
        assert two == [(second, HERE), *common]


def test_bytes_of_a_serial_line_are_everybodys() -> None:
    """A packet may come in pieces; each link cuts its own ones out."""
    with shared(1, 2) as both:
        half = packet(2)[:7]
        assert both.hear((half, None)) == [[(half, None)]] * 2


def test_a_flood_in_one_vehicles_name_costs_the_other_nothing() -> None:
    """Each has a queue of its own, and what is nobody's never fills it."""
    with shared(1, 2, 3) as all_three:
        one, two, last = all_three.shares
        flood = [(packet(2), ELSEWHERE)] * 5000
        noise = [(b"noise", ELSEWHERE)] * 5000
        all_three.wires[0].inbox = [*flood, *noise, (packet(1), HERE), (packet(3), HERE)]
        until(lambda: (packet(3), HERE) in last.receive())
        heard = [content for content, _ in _emptied(one)]
        assert heard.count(packet(1)) == 1
        assert packet(2) not in heard
        assert len(heard) < 300
        assert len(_emptied(two)) < 1100


def _emptied(share: WireShare) -> list[tuple[bytes, Peer]]:
    return [piece for _ in range(50) for piece in share.receive()]


def test_a_system_id_has_one_share() -> None:
    """The second robot is told whose it is."""
    with shared(1) as one, pytest.raises(VehicleError, match=r"robot1: system 1 .* is robot1's"):
        one.share(1)


def test_two_vehicles_fly_on_one_link_each_with_its_own_key(flight: Flight, tmp_path: Path) -> None:
    """One takes off; what is forged in the other's name, and its end, do not reach it."""
    ends: list[Stepped] = []
    with ExitStack() as opened:
        for number, family in enumerate(FAMILIES, 1):
            key = bytes(range(number, 32 + number))
            file = tmp_path / family
            file.write_text(key.hex())
            options = AutopilotOptions(
                family=family, system=number, battery=1.0 - 0.25 * number, key=key
            )
            settings = {"system": number, "signing_key": str(file)}
            made = flight(options, beside=ends[0] if ends else None, **settings)
            ends.append(opened.enter_context(made))
        left, right = ends
        assert left.vehicle.read().battery.fraction == pytest.approx(0.75, abs=0.02)
        assert right.vehicle.read().battery.fraction == pytest.approx(0.5, abs=0.02)
        right.take_off()
        assert right.autopilot.armed
        assert not left.autopilot.armed
        message = mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 9000, 0, 3, 0, 0, 0, 0, 0, 0)
        for _ in range(50):
            inject(left, message)
        left.wait(lambda: left.vehicle.read().extra["refused_packets"] >= 50)
        assert right.vehicle.read().extra["refused_packets"] == 0
        left.clock.turns.remove(left.autopilot.turn)
        left.wait(lambda: left.vehicle.read().mode is VehicleMode.LOST)
        assert right.vehicle.read().mode in {VehicleMode.HOLDING, VehicleMode.GUIDED}

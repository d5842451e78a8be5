"""Discovery of a Tello: by its state packets, by the network it makes, or by asking it."""

from __future__ import annotations

import contextlib
import ipaddress
import socket
import time
from collections.abc import Iterable, Iterator

import psutil

from aerodaas.config.extensions import VehicleDiscovery
from aerodaas.errors import VehicleError
from aerodaas.extensions.tello.commands import ENTER, Command
from aerodaas.extensions.tello.link import bound_socket, datagrams
from aerodaas.extensions.tello.settings import STATE_PORT, TelloSettings
from aerodaas.extensions.tello.state import parse_state

__all__ = ["find_tello"]

_NETWORK = ipaddress.ip_network("192.168.10.0/24")
"""The network that a Tello makes as an access point."""
_COMMAND_PORT: int = TelloSettings.model_fields["command_port"].default
_TICK = 0.05


def find_tello(
    seconds: float, asked: str | None = None, *, port: int = _COMMAND_PORT
) -> VehicleDiscovery:
    """Look for a Tello.

    A Tello says nothing until it is asked once; from then on it sends its state to whoever asked.

    Args:
        seconds: How long to listen.
        asked: Address to which `command` is sent, which switches a Tello to its SDK and moves
            nothing; None sends nothing and only listens for states.
        port: The Tello's port for commands.
    """
    notes: list[str] = []
    with contextlib.ExitStack() as opened:
        sockets: dict[str, socket.socket] = {}
        try:
            state = bound_socket("the Tello's state", STATE_PORT, raises=VehicleError)
            sockets["state"] = opened.enter_context(state)
        except VehicleError as error:
            notes.append(str(error))
        if asked is not None:
            reply = bound_socket("replies", 0, raises=VehicleError)
            sockets["reply"] = opened.enter_context(reply)
        until = time.monotonic() + seconds
        ask_again = 0.0
        while sockets and (now := time.monotonic()) < until:
            if asked is not None and now >= ask_again:
                ask_again = now + ENTER.timeout
                with contextlib.suppress(OSError):
                    sockets["reply"].sendto(ENTER.text.encode("ascii"), (asked, port))
            found = next(_answers(sockets, asked), None)
            if found is not None:
                return VehicleDiscovery(found, tuple(notes))
            time.sleep(_TICK)
    if asked is not None:
        notes.append(f"no Tello answers at {asked}")
    elif _in_its_network(_own_addresses()):
        notes.append(
            f"this host is in {_NETWORK}, as in a Tello's Wi-Fi; "
            "`--ask 192.168.10.1` asks whether it is one"
        )
    return VehicleDiscovery(None, tuple(notes))


def _answers(sockets: dict[str, socket.socket], asked: str | None) -> Iterator[str]:
    """Addresses from which a Tello's state or reply has come."""
    if "state" in sockets:
        for content, address, _ in datagrams(sockets["state"]):
            if parse_state(content) is not None:
                yield address
    if "reply" in sockets:
        for content, address, _ in datagrams(sockets["reply"]):
            if address == asked and Command.succeeded(content.decode("ascii", "replace").strip()):
                yield address


def _own_addresses() -> list[str]:
    every = (one for interface in psutil.net_if_addrs().values() for one in interface)
    return [one.address for one in every if one.family is socket.AF_INET]


def _in_its_network(addresses: Iterable[str]) -> bool:
    return any(ipaddress.ip_address(one) in _NETWORK for one in addresses)

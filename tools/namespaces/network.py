"""Machines of namespaces on one switch, each behind a link of its own.

The switch is a machine, too: a bridge in namespaces of its own. What it has of this machine is one
end of a cable, which vanishes with the other. So a process that is killed leaves no device.
"""

from __future__ import annotations

import contextlib
import ipaddress
import os
import secrets
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from typing_extensions import Self

from aerodaas.actors.private_folder import private_folder
from aerodaas.errors import AeroDaaSError, ConfigError
from tools.namespaces.links import BRIDGE, NetemLink, RelayLink, ShapedLink, has_netem, plug
from tools.namespaces.machine import Machine, run
from tools.namespaces.shape import Shape

__all__ = ["LocalNetwork", "RemoteMachine"]

_NETWORKS = tuple(ipaddress.IPv4Network(f"10.{second}.0.0/24") for second in range(77, 97))
_SHARED_MEMORY = Path("/dev/shm")  # noqa: S108 - each machine has its own


@dataclass
class RemoteMachine:
    """A machine behind a link."""

    name: str
    address: str
    machine: Machine
    link: ShapedLink
    shape: Shape


class LocalNetwork:
    """Comes up when entered; all that it started ends when it is left.

    Raises ConfigError without root, AeroDaaSError if the kernel refuses.
    """

    def __init__(self) -> None:
        if os.name != "posix" or os.geteuid() != 0:
            raise ConfigError(
                "network namespaces need root: run `sudo python -m tools.namespaces …`; without "
                "root, applications run on one machine without --address"
            )
        self._id = secrets.token_hex(2)
        self._stack = contextlib.ExitStack()
        self._hosts: Iterator[ipaddress.IPv4Address] = iter(())
        self.far: dict[str, RemoteMachine] = {}
        """The machines, by name."""

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            self.folder = Path(tempfile.mkdtemp(prefix="aerodaas-"))
            stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
            self._hosts = _free_network().hosts()
            self.host = str(next(self._hosts))
            self._switch = Machine("switch")
            stack.callback(self._switch.power_off)
            self._switch.run("ip", "link", "add", BRIDGE, "type", "bridge", "stp_state", "0")
            self._switch.run("ip", "link", "set", BRIDGE, "up")
            here, there = f"ad{self._id}", f"ad{self._id}s"
            run("ip", "link", "add", here, "type", "veth", "peer", "name", there)
            plug(there, self._switch)
            run("ip", "address", "add", f"{self.host}/24", "dev", here)
            run("ip", "link", "set", here, "up")
            self._link = NetemLink if has_netem() else RelayLink
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def add_here(self, name: str) -> Machine:
        """A machine that shares this one's network and files, but not its processes."""
        machine = Machine(name, network=False)
        self._stack.callback(machine.power_off)
        return machine

    def add(self, name: str, scratch: Sequence[Path] = ()) -> RemoteMachine:
        """A machine with an address and shared memory of its own, behind an unshaped link.

        It has the folders in `scratch` to itself, too.
        """
        address = str(next(self._hosts))
        machine = Machine(name, scratch=[_SHARED_MEMORY, private_folder("streams"), *scratch])
        self._stack.callback(machine.power_off)
        label = f"ad{self._id}{len(self.far)}"
        link: ShapedLink = self._link(label, self._switch, machine, f"{address}/24")
        self._stack.callback(link.close)
        # Leads nowhere further; Ray takes the way to the Internet for a host's own address.
        machine.run("ip", "route", "add", "default", "via", self.host)
        link.shape(Shape())
        self.far[name] = RemoteMachine(name, address, machine, link, Shape())
        return self.far[name]

    def is_cut(self, name: str) -> bool:
        """Tell whether the machine `name` is cut off."""
        words = ("ip", "-brief", "link", "show", self.far[name].link.near)
        return self._switch.run(*words).split()[1] == "DOWN"

    def shape(self, name: str, shape: Shape) -> None:
        """Change the link to the machine `name`."""
        self.far[name].shape = shape
        self.far[name].link.shape(shape)


def _free_network() -> ipaddress.IPv4Network:
    taken = run("ip", "-o", "-4", "address") + run("ip", "route")
    for network in _NETWORKS:
        if str(network.network_address).removesuffix("0") not in taken:
            return network
    raise AeroDaaSError("10.77.0.0/24 to 10.96.0.0/24 are all taken on this machine")

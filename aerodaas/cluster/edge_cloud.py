"""An edge and a cloud on one Linux machine: real Ray nodes, shaped links, own addresses.

This machine itself is the edge, so that an application started here, a simulated vehicle on the
loopback interface or a camera on USB is beside it as it would be beside a drone. The head runs on
the edge: a cloud that is cut off must not take the control of the cluster with it. Each cloud
node, and each further edge, is a machine of its own behind a link of its own.
"""

from __future__ import annotations

import contextlib
import ipaddress
import os
import secrets
import shutil
import socket
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from typing_extensions import Self

from aerodaas.cluster.links import Link, NetemLink, RelayLink, has_netem
from aerodaas.cluster.machine import Machine, run
from aerodaas.cluster.ray_node import restart_control_service, start_head, start_worker
from aerodaas.cluster.shape import Shape
from aerodaas.errors import AeroDaaSError, ConfigError

__all__ = ["EdgeCloud", "Far"]

_NETWORKS = tuple(ipaddress.ip_network(f"10.{second}.0.0/24") for second in range(77, 97))
_MOST = 32
"""Machines on one computer; each takes half a gigabyte."""
_OWN_FOLDERS = (Path("/dev/shm"), Path("/tmp/iceoryx2"))  # noqa: S108 - each machine has its own
_EDGE = "edge"


@dataclass
class Far:
    """A machine behind a link."""

    name: str
    address: str
    machine: Machine
    link: Link
    kind: str
    shape: Shape


class EdgeCloud:
    """Comes up when entered, and is taken down by the ids that it started when left.

    Raises ConfigError without root or with settings that cannot be, AeroDaaSError if the kernel
    or Ray refuses.
    """

    def __init__(
        self,
        cloud: int = 1,
        *,
        edges: int = 1,
        shape: Shape | None = None,
        port: int = 0,
        variables: Mapping[str, str] | None = None,
    ) -> None:
        """Plan `cloud` nodes behind links of `shape`, and `edges` behind links of no delay.

        The head listens at `port`, 0 for a free one. `variables` go into the environment of Ray's processes.
        """
        if cloud < 0 or edges < 1 or cloud + edges > _MOST:
            raise ConfigError(f"an edge–cloud here has 1 edge and up to {_MOST - 1} other nodes")
        if os.name != "posix" or os.geteuid() != 0:
            raise ConfigError(
                "network namespaces need root: run `sudo aerodaas cluster local …`; without root, "
                "applications run on one machine without --address"
            )
        self._shape = shape or Shape()
        self.port = port
        self._counts = {"cloud": cloud, _EDGE: edges - 1}
        self._variables = dict(variables or {})
        self._id = secrets.token_hex(2)
        self._bridge = f"ad{self._id}"
        self._stack = contextlib.ExitStack()
        self.far: dict[str, Far] = {}
        """Machines other than this one, by name: `cloud1`, ..., `edge2`, ..."""

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            self._start(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def address(self) -> str:
        """What `--address` takes."""
        return f"{self.host}:{self.port}"

    def shape(self, name: str, shape: Shape) -> None:
        """Change the link to the machine `name`."""
        self.far[name].shape = shape
        self.far[name].link.shape(shape)

    def cut(self, name: str) -> None:
        """Cut the machine `name` off."""
        self.far[name].link.cut()

    def mend(self, name: str) -> None:
        """Connect a machine that was cut off."""
        self.far[name].link.mend()

    def kill(self, name: str) -> None:
        """Take the power from the machine `name`."""
        self.far[name].machine.power_off()

    def restart_control_service(self) -> None:
        """Kill the head's control service (GCS) and start it anew."""
        restart_control_service(self.edge)

    def clouds(self) -> list[str]:
        """Names of the cloud's machines."""
        return [name for name, far in self.far.items() if far.kind == "cloud"]

    def _start(self, stack: contextlib.ExitStack) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="aerodaas-"))
        stack.callback(shutil.rmtree, self.folder, ignore_errors=True)
        self._network = _free_network()
        hosts = self._network.hosts()
        self.host = str(next(hosts))
        self.port = self.port or _free_port()
        run("ip", "link", "add", self._bridge, "type", "bridge", "stp_state", "0")
        stack.callback(run, "ip", "link", "del", self._bridge)
        run("ip", "address", "add", f"{self.host}/24", "dev", self._bridge)
        run("ip", "link", "set", self._bridge, "up")
        self.edge = Machine(_EDGE, network=False)
        stack.callback(self.edge.power_off)
        self._start_ray(self.edge, self.host, _EDGE)
        kind_of_link = NetemLink if has_netem() else RelayLink
        for kind, count in self._counts.items():
            for number in range(1, count + 1):
                name = f"{kind}{number if kind == 'cloud' else number + 1}"
                self._join(stack, name, kind, str(next(hosts)), kind_of_link)

    def _join(
        self,
        stack: contextlib.ExitStack,
        name: str,
        kind: str,
        address: str,
        kind_of_link: type[Link],
    ) -> None:
        for folder in _OWN_FOLDERS:
            folder.mkdir(exist_ok=True)
        machine = Machine(name, scratch=[*_OWN_FOLDERS, self.folder])
        stack.callback(machine.power_off)
        link = kind_of_link(
            f"ad{self._id}{len(self.far)}", self._bridge, machine, f"{address}/24"
        )
        stack.callback(link.close)
        shape = self._shape if kind == "cloud" else Shape()
        self.far[name] = Far(name, address, machine, link, kind, shape)
        link.shape(Shape())
        self._start_ray(machine, address, kind)
        link.shape(shape)

    def _start_ray(self, machine: Machine, address: str, kind: str) -> None:
        resources = {kind: 1.0}
        if machine is self.edge:
            start_head(machine, address, self.port, self.folder, resources, self._variables)
        else:
            start_worker(machine, address, self.address, resources, self._variables)


def _free_network() -> ipaddress.IPv4Network:
    taken = run("ip", "-o", "-4", "address") + run("ip", "route")
    for network in _NETWORKS:
        if str(network.network_address).removesuffix(".0") + "." not in taken:
            return network  # type: ignore[return-value]
    raise AeroDaaSError("10.77.0.0/24 to 10.96.0.0/24 are all taken on this machine")


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])

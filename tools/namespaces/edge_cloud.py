"""An edge and a cloud on one Linux machine: real Ray nodes, shaped links, own addresses.

This machine itself is the edge, so that an application started here, a simulated vehicle on the
loopback interface or a camera on USB is beside it as it would be beside a drone. The head runs on
the edge: a cloud that is cut off must not take the control of the cluster with it. Each cloud
node, and each further edge, is a machine of its own behind a link of its own.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Mapping

from typing_extensions import Self

from aerodaas.errors import ConfigError
from tools.namespaces.network import LocalNetwork, RemoteMachine
from tools.namespaces.ray_node import restart_control_service, start_head, start_worker
from tools.namespaces.shape import Shape

__all__ = ["EdgeCloud"]

_MOST = 32
"""Machines on one computer; each takes some hundred megabytes."""


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

        The head listens at `port`, 0 for a free one. `variables` go into the environment of
        Ray's processes.
        """
        if cloud < 0 or edges < 1 or cloud + edges > _MOST:
            raise ConfigError(f"an edge-cloud here has 1 edge and up to {_MOST - 1} other nodes")
        self._shape = shape or Shape()
        self._kinds = {f"cloud{number}": "cloud" for number in range(1, cloud + 1)}
        self._kinds |= {f"edge{number}": "edge" for number in range(2, edges + 1)}
        self._variables = dict(variables or {})
        self._stack = contextlib.ExitStack()
        self._network = LocalNetwork()
        self.port = port

    def __enter__(self) -> Self:
        with contextlib.ExitStack() as stack:
            network = stack.enter_context(self._network)
            self.host = network.host
            self.port = self.port or _free_port()
            self.edge = network.add_here("edge1")
            folder = network.folder
            resources = {"edge": 1.0}
            start_head(self.edge, self.host, self.port, folder, resources, self._variables)
            for name, kind in self._kinds.items():
                far = network.add(name, [folder])
                self._join(far, {kind: 1.0})
                if kind == "cloud":
                    network.shape(name, self._shape)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def address(self) -> str:
        """What `--address` takes."""
        return f"{self.host}:{self.port}"

    @property
    def far(self) -> Mapping[str, RemoteMachine]:
        """Machines other than this one, by name: `cloud1`, ..., `edge2`, ..."""
        return self._network.far

    def clouds(self) -> list[str]:
        """Names of the cloud's machines."""
        return [name for name in self.far if self._kinds[name] == "cloud"]

    def add(self, name: str, resources: Mapping[str, float], **variables: str) -> RemoteMachine:
        """One more machine behind an unshaped link, with a node that offers `resources`.

        Without resources there is no node yet.
        """
        far = self._network.add(name, [self._network.folder])
        self._kinds[name] = next(iter(resources), "")
        if resources:
            self._join(far, resources, variables)
        return far

    def join_again(self, name: str) -> None:
        """Start a second node on the machine `name`, as no one should."""
        self._join(self.far[name], {self._kinds[name]: 1.0})

    def shape(self, name: str, shape: Shape) -> None:
        """Change the link to the machine `name`."""
        self._network.shape(name, shape)

    def cut(self, name: str) -> None:
        """Cut the machine `name` off."""
        self.far[name].link.cut()

    def is_cut(self, name: str) -> bool:
        """Tell whether the machine `name` is cut off."""
        return self._network.is_cut(name)

    def mend(self, name: str) -> None:
        """Connect a machine that was cut off."""
        self.far[name].link.mend()

    def kill(self, name: str) -> None:
        """Take the power from the machine `name`."""
        self.far[name].machine.power_off()

    def restart_control_service(self) -> None:
        """Kill the head's control service (GCS) and start it anew."""
        restart_control_service(self.edge)

    def _join(
        self,
        far: RemoteMachine,
        resources: Mapping[str, float],
        more: Mapping[str, str] | None = None,
    ) -> None:
        variables = {**self._variables, **(more or {})}
        start_worker(far.machine, far.address, self.address, resources, variables)


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("", 0))
        return int(probe.getsockname()[1])

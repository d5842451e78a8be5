"""Links of shaped bandwidth, latency and loss between this machine and others of namespaces.

Bandwidth is the kernel's token bucket (tc-tbf) at both ends. Latency and loss are netem's where
the kernel has it; elsewhere packets pass through a relay in user space over TAP devices.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from abc import ABC, abstractmethod

from aerodaas.errors import AeroDaaSError
from tools.namespaces import relay
from tools.namespaces.machine import Machine, run
from tools.namespaces.shape import Shape

__all__ = ["BRIDGE", "NetemLink", "RelayLink", "ShapedLink", "has_netem", "plug"]

BRIDGE = "bridge"
"""Name of the bridge inside a switch."""

_UNLIMITED = 40e9
"""Bits per second for want of a limit: a bucket that never runs dry."""
_BURST_SECONDS = 0.002
_LEAST_BURST = 16_000
"""Bytes; a bucket must hold some packets, the largest after segmentation offload included."""
_QUEUE = "100ms"
"""How long a packet may wait for bandwidth before it is dropped, as in a shallow router."""


def has_netem() -> bool:
    """Tell whether this kernel has netem, by trying on a device of an own, short-lived kind."""
    probe = "adprobe"
    try:
        run("ip", "link", "add", probe, "type", "dummy")
    except AeroDaaSError:
        return False
    try:
        run("tc", "qdisc", "add", "dev", probe, "root", "netem", "delay", "1ms")
    except AeroDaaSError:
        return False
    else:
        return True
    finally:
        run("ip", "link", "del", probe)


class ShapedLink(ABC):
    """From the bridge of a switch to another machine, where it has the address `address`.

    Its devices live in those machines' namespaces, and go with them at the latest.
    """

    def __init__(self, name: str, switch: Machine, machine: Machine, address: str) -> None:
        self.near = f"{name}n"
        self.far = f"{name}f"
        self._switch = switch
        self._machine = machine
        self._connect()
        run("ip", "link", "set", self.far, "netns", str(machine.pid))
        plug(self.near, switch)
        machine.run("ip", "address", "add", address, "dev", self.far)
        machine.run("ip", "link", "set", self.far, "up")

    def shape(self, shape: Shape) -> None:
        """Behave like this from now on."""
        rate = shape.bandwidth or _UNLIMITED
        burst = max(_LEAST_BURST, round(rate / 8 * _BURST_SECONDS))
        bucket = ["tbf", "rate", f"{rate:.0f}bit", "burst", f"{burst}b", "latency", _QUEUE]
        self._switch.run("tc", *_replace(self.near, "root", "handle", "1:"), *bucket)
        self._machine.run("tc", *_replace(self.far, "root", "handle", "1:"), *bucket)
        self._delay(shape.rtt / 2, shape.loss)

    def cut(self) -> None:
        """Lose everything from now on, both ways."""
        self._switch.run("ip", "link", "set", self.near, "down")

    def mend(self) -> None:
        """Undo `cut`."""
        self._switch.run("ip", "link", "set", self.near, "up")

    @abstractmethod
    def close(self) -> None:
        """Take the link away."""

    @abstractmethod
    def _connect(self) -> None:
        """Make the two devices."""

    @abstractmethod
    def _delay(self, delay: float, loss: float) -> None:
        """Delay by so many seconds, and lose this share, each way."""


class RelayLink(ShapedLink):
    """Two TAP devices and the relay between them."""

    def _connect(self) -> None:
        self._relay = subprocess.Popen(  # noqa: S603 - this project's own words
            [sys.executable, relay.__file__, self.near, self.far],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        assert self._relay.stdout is not None  # noqa: S101 - asked for
        if self._relay.stdout.readline().strip() != b"ready":
            _, said = self._relay.communicate()
            reason = (said.decode(errors="replace").strip().splitlines() or ["?"])[-1]
            raise AeroDaaSError(f"cannot relay packets: {reason}; is /dev/net/tun there?")

    def _delay(self, delay: float, loss: float) -> None:
        assert self._relay.stdin is not None  # noqa: S101 - asked for
        self._relay.stdin.write(json.dumps({"delay": delay, "loss": loss}).encode() + b"\n")
        self._relay.stdin.flush()

    def close(self) -> None:
        """End the relay; its devices go with it."""
        assert self._relay.stdin is not None  # noqa: S101 - asked for
        with contextlib.suppress(OSError):
            self._relay.stdin.close()
        self._relay.wait()


class NetemLink(ShapedLink):
    """A pair of virtual Ethernet devices, delayed by the kernel."""

    def _connect(self) -> None:
        run("ip", "link", "add", self.near, "type", "veth", "peer", "name", self.far)

    def _delay(self, delay: float, loss: float) -> None:
        words = ["netem", "delay", f"{delay * 1e6:.0f}us", "loss", f"{loss * 100:g}%"]
        self._switch.run("tc", *_replace(self.near, "parent", "1:1", "handle", "2:"), *words)
        self._machine.run("tc", *_replace(self.far, "parent", "1:1", "handle", "2:"), *words)

    def close(self) -> None:
        """Nothing: the devices go with the machines."""


def plug(device: str, switch: Machine) -> None:
    """Attach a device of this machine to the bridge of a switch."""
    run("ip", "link", "set", device, "netns", str(switch.pid))
    switch.run("ip", "link", "set", device, "master", BRIDGE, "up")


def _replace(device: str, *place: str) -> list[str]:
    return ["qdisc", "replace", "dev", device, *place]

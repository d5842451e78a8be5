"""A network of the laboratory played on real links."""

from __future__ import annotations

import threading
import time
from dataclasses import replace

from typing_extensions import Self

from aerodaas.clock import NANOSECONDS
from aerodaas.schedulers.lab.network import Network
from tools.namespaces.edge_cloud import EdgeCloud

__all__ = ["TracePlayer"]

_STEP = 0.25
"""Seconds from one change of the links to the next; a change takes some 10 ms."""


class TracePlayer:
    """Plays `network` on all links to the cloud, over and over, while it is entered.

    Its latency is added to each link's round trip, its bandwidth replaces the link's, and in an
    outage the link is cut. `duration` seconds make one round.
    """

    def __init__(self, cluster: EdgeCloud, network: Network, duration: float) -> None:
        self._cluster = cluster
        self._network = network
        self._duration = duration
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="trace", daemon=True)
        self._plain = {name: cluster.far[name].shape for name in cluster.clouds()}
        self._out = False

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def apply(self, seconds: float) -> None:
        """Give the links the shape that they have `seconds` into the trace."""
        stamp = round(seconds % self._duration * NANOSECONDS)
        rate = self._network.bandwidth_at(stamp)
        out = self._network.out_at(stamp) or rate == 0
        latency = self._network.latency_at(stamp) / NANOSECONDS
        for name, plain in self._plain.items():
            shape = replace(
                plain,
                rtt=plain.rtt + latency,
                bandwidth=rate * 8 if rate else plain.bandwidth,
            )
            if shape != self._cluster.far[name].shape:
                self._cluster.shape(name, shape)
            if out != self._out:
                (self._cluster.cut if out else self._cluster.mend)(name)
        self._out = out

    def _run(self) -> None:
        began = time.monotonic()
        while not self._ended.wait(_STEP):
            self.apply(time.monotonic() - began)

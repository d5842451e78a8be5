"""What Ray alone takes to bring the bytes of a frame to an actor on another node, in one call."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import ray
from _latency_ours import HEIGHT, RATE, WIDTH

__all__ = ["frames_by_ray"]


class _Reader:
    def __init__(self) -> None:
        self.ages: list[float] = []

    def deliver(self, data: bytes, sent: float) -> int:
        """Note how old the bytes are."""
        self.ages.append(1000 * (time.time() - sent))
        return len(data)

    def noted(self) -> list[float]:
        """Milliseconds of each call."""
        return self.ages


class _Sender:
    def __init__(self, reader: Any) -> None:  # noqa: ANN401 - a Ray actor handle
        self._reader = reader
        pixels = np.random.default_rng(0).integers(0, 255, HEIGHT * WIDTH * 3, dtype=np.uint8)
        self._data = pixels.tobytes()

    def send(self, count: int) -> None:
        """Send `count` frames at the camera's rate."""
        calls = []
        for _ in range(count):
            calls.append(self._reader.deliver.remote(self._data, time.time()))
            time.sleep(1 / RATE)
        ray.get(calls)


def frames_by_ray(count: int, resources: tuple[str, str]) -> list[float]:
    """Milliseconds of each of `count` calls between the nodes that have these resources."""
    here, there = resources
    reader = _placed(_Reader, there).remote()
    sender = _placed(_Sender, here).remote(reader)
    ray.get(sender.send.remote(count))
    ages: list[float] = ray.get(reader.noted.remote())
    for actor in (sender, reader):
        ray.kill(actor)
    return ages


def _placed(actor: type, resource: str) -> Any:  # noqa: ANN401 - a Ray actor class
    make: Any = ray.remote(num_cpus=0, resources={resource: 0.1})
    return make(actor)

"""Training in several processes at once: each takes its share of every batch."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TypeVar

import torch
from torch import distributed, nn

__all__ = ["average_gradients", "in_processes", "local_batch", "process_group", "rank"]

Step = TypeVar("Step")


@contextmanager
def process_group(size: int, work: Callable[[], object]) -> Iterator[None]:
    """Be the first of `size` processes (1 or more); the others call `work`, which is pickled.

    Threads are shared out evenly. Processes left when this ends are ended.
    """
    if size == 1:
        yield
        return
    with tempfile.TemporaryDirectory() as folder:
        threads = torch.get_num_threads()
        each = max(1, threads // size)
        meeting = f"file://{Path(folder, 'meeting')}"
        fresh = multiprocessing.get_context("spawn")  # a forked process can't use PyTorch's threads
        others = [
            fresh.Process(target=_join, args=(number, size, each, meeting, work), daemon=True)
            for number in range(1, size)
        ]
        for process in others:
            process.start()
        distributed.init_process_group("gloo", meeting, rank=0, world_size=size)
        torch.set_num_threads(each)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
            distributed.destroy_process_group()
            for process in others:
                process.terminate()
                process.join()


def _join(number: int, size: int, threads: int, meeting: str, work: Callable[[], object]) -> None:
    torch.set_num_threads(threads)
    distributed.init_process_group("gloo", meeting, rank=number, world_size=size)
    work()


def in_processes(size: int, course: Callable[[], Iterator[Step]]) -> Iterator[Step]:
    """Take all steps of `course`, which is pickled, in `size` processes; yields the first's."""
    with process_group(size, partial(_walk, course)):
        yield from course()


def _walk(course: Callable[[], Iterator[object]]) -> None:
    for _ in course():
        pass


def rank() -> int:
    """Return this process's number in its group, from 0."""
    return distributed.get_rank() if distributed.is_initialized() else 0


def local_batch(batch: int) -> int:
    """How many of `batch` pictures are this process's own."""
    return batch // distributed.get_world_size() if distributed.is_initialized() else batch


def average_gradients(network: nn.Module) -> None:
    """Replace the gradients by their means over the group."""
    if not distributed.is_initialized():
        return
    gradients = [p.grad for p in network.parameters() if p.grad is not None]
    flat = torch.cat([gradient.flatten() for gradient in gradients])
    distributed.all_reduce(flat)
    flat /= distributed.get_world_size()
    parts = flat.split([gradient.numel() for gradient in gradients])
    for gradient, part in zip(gradients, parts, strict=True):
        gradient.copy_(part.view(gradient.shape))

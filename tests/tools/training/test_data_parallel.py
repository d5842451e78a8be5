"""Several processes train as one: they share each batch and average their gradients."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
import torch

from tools.training.data_parallel import average_gradients, local_batch, process_group, rank


def _learn_from_own(number: float) -> torch.Tensor:
    """Return the gradient, averaged, of a weight whose input is `number`."""
    network = torch.nn.Linear(1, 1, bias=False)
    network(torch.full((1, 1), number)).sum().backward()
    average_gradients(network)
    gradient = network.weight.grad
    assert gradient is not None
    return gradient


def _beside(folder: Path) -> None:
    torch.save((_learn_from_own(5.0), rank(), local_batch(32)), folder / "beside.pt")
    torch.distributed.barrier()


def test_alone_nothing_is_shared() -> None:
    """A gradient is one's own, and so is the batch."""
    with process_group(1, partial(pytest.fail, "another process was started")):
        assert _learn_from_own(3.0).item() == pytest.approx(3.0)
        assert (rank(), local_batch(32)) == (0, 32)


@pytest.mark.slow
def test_two_processes_learn_the_same(tmp_path: Path) -> None:
    """The mean of both gradients, from halves of the batch; afterwards, one is alone again."""
    with process_group(2, partial(_beside, tmp_path)):
        assert _learn_from_own(3.0).item() == pytest.approx(4.0)
        assert (rank(), local_batch(32)) == (0, 16)
        torch.distributed.barrier()
    gradient, number, pictures = torch.load(tmp_path / "beside.pt", weights_only=True)
    assert (gradient.item(), number, pictures) == (pytest.approx(4.0), 1, 16)
    assert local_batch(32) == 32

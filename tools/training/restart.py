"""Weights to begin with, out of a detector that was exported, and what of them is kept.

An export has its batch norms folded into its convolutions. They are put back as norms of what the
convolutions give on some pictures, so that the network answers as the export does, and learns on.
What has learnt on may be mixed with what it began from, which keeps what the new pictures do not
show (Wortsman et al., "Robust fine-tuning of zero-shot models", 2022).
"""

from __future__ import annotations

from pathlib import Path

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from tools.training.network import DetectorNetwork
from tools.training.yolox import Features, FrozenYolox

__all__ = ["learn_on_from", "mix"]


def learn_on_from(path: Path, network: DetectorNetwork, features: Features) -> None:
    """Give `network` the weights of the detector at `path` (.onnx).

    `features` of some tens of pictures tell the norms. Raises ValueError where the file is no
    detector of this architecture.
    """
    convs = _convolutions(network)
    handles = []
    for (conv, norm), (weight, bias) in zip(convs, _exported(path, convs), strict=True):
        conv.weight.data.copy_(weight)
        if norm is not None:
            handles.append(norm.register_forward_pre_hook(_Put(bias)))
        elif conv.bias is not None:
            conv.bias.data.copy_(bias)
    with torch.no_grad():
        network.eval()(features)
    for handle in handles:
        handle.remove()


def mix(network: nn.Module, path: Path, share: float) -> None:
    """Move `network`, its norms folded in, by `share` (0 to 1) towards the detector at `path`.

    Raises ValueError where the file is no detector of this architecture.
    """
    convs = _convolutions(network)
    for (conv, _), parts in zip(convs, _exported(path, convs), strict=True):
        for own, part in zip((conv.weight, conv.bias), parts, strict=True):
            if own is not None:
                own.data.lerp_(part, share)


def _exported(
    path: Path, convs: list[tuple[nn.Conv2d, nn.BatchNorm2d | None]]
) -> list[tuple[Tensor, Tensor]]:
    """Weight and bias that the detector at `path` has for each of `convs`."""
    graph = onnx.load(str(path)).graph
    constants = {item.name: item for item in graph.initializer}
    names = [node.input[1:] for node in graph.node if node.op_type == "Conv"]
    frozen = sum(isinstance(module, nn.Conv2d) for module in FrozenYolox().modules())
    if len(names) != frozen + len(convs):
        raise ValueError(f"{path} has {len(names)} convolutions, not {frozen + len(convs)}")
    found = []
    for (conv, _), (first, second) in zip(convs, names[frozen:], strict=True):
        weight, bias = (
            torch.from_numpy(numpy_helper.to_array(constants[name]).copy())
            for name in (first, second)
        )
        if conv.weight.shape != weight.shape:
            raise ValueError(f"{path} is no detector of this architecture")
        found.append((weight, bias))
    return found


def _convolutions(network: nn.Module) -> list[tuple[nn.Conv2d, nn.BatchNorm2d | None]]:
    """Convolutions and the norm after each, in the order in which they are run and exported."""
    found: list[tuple[nn.Conv2d, nn.BatchNorm2d | None]] = []
    for module in network.modules():
        if isinstance(module, nn.Conv2d):
            found.append((module, None))
        elif isinstance(module, nn.BatchNorm2d):
            found[-1] = (found[-1][0], module)
    return found


class _Put:
    """Before a norm is first run: make it add `bias` alone to what it is given."""

    def __init__(self, bias: Tensor) -> None:
        self._bias = bias

    def __call__(self, norm: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        if not isinstance(norm, nn.BatchNorm2d):
            raise TypeError(f"{norm} is no batch norm")
        given = inputs[0].float()
        mean, variance = given.mean((0, 2, 3)), given.var((0, 2, 3))
        norm.running_mean, norm.running_var = mean.clone(), variance.clone()
        norm.weight.data.copy_((variance + norm.eps).sqrt())
        norm.bias.data.copy_(mean + self._bias.to(mean.device))

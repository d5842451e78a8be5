"""From the keypoint network's weights to the ONNX file that ships."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import Tensor, nn

from tools.training.export import fused, save_onnx
from tools.training.pose_cuts import CUT
from tools.training.pose_network import Joints, places

__all__ = ["export_pose"]


class _Pose(nn.Module):
    """Cuts (n, 3, s, s) to keypoints (n, 17, 3): u, v in pixels of the cut, confidence."""

    def __init__(self, network: Joints) -> None:
        super().__init__()
        self.network = network

    def forward(self, cuts: Tensor) -> Tensor:
        """Find joints."""
        maps, found = self.network(cuts)
        return torch.cat([places(maps), found.sigmoid()[..., None]], 2)


def export_pose(weights: Path, path: Path) -> None:
    """Write the network, its batch norms folded, for any number of cuts at once."""
    network = Joints()
    network.load_state_dict(torch.load(weights, weights_only=True, map_location="cpu"))
    fused(network.eval())
    save_onnx(
        _Pose(network),
        path,
        ("cuts", "keypoints"),
        torch.zeros(1, 3, CUT, CUT),
        {"task": "keypoints", "imgsz": str([CUT, CUT])},
        axes={port: {0: "count"} for port in ("cuts", "keypoints")},
    )

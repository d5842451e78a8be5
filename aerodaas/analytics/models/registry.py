"""Models by name: where each is released, what it is, and the file that bears the name.

Only models are here whose licence lets anybody fly with them; Ultralytics' (AGPL-3.0) work as files
that users bring. The releases publish no checksums. Those below were recorded, with the same value,
by several independent projects that pin the files, and that of yolox-s by OpenCV Zoo, which
distributes the same file. A file with any other checksum is not used.

Sources: github.com/Megvii-BaseDetection/YOLOX (README, demo/ONNXRuntime) and
github.com/open-mmlab/mmpose (projects/rtmpose).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from aerodaas.errors import UnknownIdError

__all__ = ["REGISTRY", "Archive", "RegisteredModel", "registered"]

_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0"
_RTMPOSE = "https://download.openmmlab.com/mmpose/v1/projects/rtmposev1/onnx_sdk"
_COCO = "COCO's 80 classes"


@dataclass(frozen=True)
class Archive:
    """A zip file in which a model is released."""

    sha256: str
    size: int
    """Bytes."""
    member: str
    """Name of the model's file in it, in whatever folder."""


@dataclass(frozen=True)
class RegisteredModel:
    """One released model."""

    name: str
    task: Literal["detect", "pose"]
    address: str
    """Of the release's file: the model, or the archive with it."""
    sha256: str
    """Of the model."""
    size: int
    """Bytes of the model."""
    licence: str
    """SPDX id."""
    finds: str
    input: tuple[int, int]
    """Width and height in pixels."""
    published: str
    """Accuracy that its authors publish; nothing that was measured here."""
    archive: Archive | None = None

    @property
    def file(self) -> str:
        """Its name among the fetched models."""
        return f"{self.name}.onnx"

    @property
    def download(self) -> int:
        """Bytes that are fetched."""
        return self.size if self.archive is None else self.archive.size


_ALL = (
    RegisteredModel(
        "yolox-nano",
        "detect",
        f"{_YOLOX}/yolox_nano.onnx",
        "c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d",
        3_659_407,
        "Apache-2.0",
        _COCO,
        (416, 416),
        "COCO AP 0.258",
    ),
    RegisteredModel(
        "yolox-tiny",
        "detect",
        f"{_YOLOX}/yolox_tiny.onnx",
        "427cc366d34e27ff7a03e2899b5e3671425c262ea2291f88bb942bc1cc70b0f7",
        20_219_662,
        "Apache-2.0",
        _COCO,
        (416, 416),
        "COCO AP 0.328",
    ),
    RegisteredModel(
        "yolox-s",
        "detect",
        f"{_YOLOX}/yolox_s.onnx",
        "c5c2d13e59ae883e6af3b45daea64af4833a4951c92d116ec270d9ddbe998063",
        35_858_002,
        "Apache-2.0",
        _COCO,
        (640, 640),
        "COCO AP 0.405",
    ),
    RegisteredModel(
        "rtmpose-t",
        "pose",
        f"{_RTMPOSE}/rtmpose-t_simcc-body7_pt-body7_420e-256x192-026a1439_20230504.zip",
        "a6c2f6a3896a4d51131d14d7a80a3d08b50f559af5a58a45d5b098aef510a70f",
        13_350_364,
        "Apache-2.0",
        "COCO's 17 keypoints",
        (192, 256),
        "COCO keypoint AP 0.659",
        Archive(
            "937003a70832d9cc34ea16927f504792f3133e92dda1b9c626236bbbe9e805cb",
            12_547_710,
            "end2end.onnx",
        ),
    ),
    RegisteredModel(
        "rtmpose-s",
        "pose",
        f"{_RTMPOSE}/rtmpose-s_simcc-body7_pt-body7_420e-256x192-acd4a1ef_20230504.zip",
        "9aeb635b83f86aea45cf45d85798f7eba1a162de8e0d721c44e54fe5eebaf47d",
        21_890_172,
        "Apache-2.0",
        "COCO's 17 keypoints",
        (192, 256),
        "COCO keypoint AP 0.697",
        Archive(
            "7673922e531014906ca4f0f239b7e233b740146a10b632deaa2a28d45470d802",
            20_496_303,
            "end2end.onnx",
        ),
    ),
)

REGISTRY = {model.name: model for model in _ALL}
"""All models by name."""


def registered(name: str) -> RegisteredModel:
    """The model of this name; raises UnknownIdError with the names that there are."""
    if name not in REGISTRY:
        raise UnknownIdError("model", name, list(REGISTRY))
    return REGISTRY[name]

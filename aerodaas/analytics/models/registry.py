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

from aerodaas.types.errors import UnknownIdError

__all__ = ["REGISTRY", "Archive", "RegisteredModel", "registered"]

_YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0"
_COCO = "COCO's 80 classes"


@dataclass(frozen=True)
class Archive:
    """A zip file in which a model is released."""

    sha256: str
    size: int
    """Bytes."""
    member: str
    """Path of the model in it."""


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
)

REGISTRY = {model.name: model for model in _ALL}
"""All models by name."""


def registered(name: str) -> RegisteredModel:
    """The model of this name; raises UnknownIdError with the names that there are."""
    if name not in REGISTRY:
        raise UnknownIdError("model", name, list(REGISTRY))
    return REGISTRY[name]

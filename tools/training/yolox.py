"""The frozen part of the detector: YOLOX-nano's backbone, neck and head, as Megvii released them.

Its weights were learnt from photographs (COCO). What is learnt from renders stands on its features
and never changes them, which is what makes it work on photographs, too (Hinterstoisser et al.,
"On Pre-Trained Image Features and Synthetic Images for Deep Learning", 2018).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto, helper, numpy_helper
from onnx.shape_inference import infer_shapes
from onnx.utils import Extractor

from aerodaas.analytics.detection.providers import open_session

__all__ = ["FEATURES", "OWN", "SIZE", "FeatureExtractor", "frozen_part"]

SIZE = (256, 416)
"""Height and width of the input: a picture of 16:9 leaves little of it empty."""

FEATURES = {
    "input.175": (64, 8),
    "input.471": (64, 8),
    "input.531": (128, 16),
    "input.591": (256, 32),
}
"""Tensors that the new heads see, with their channels and strides: the backbone's third stage,
which still tells colours well, and the three levels of the neck."""

OWN = ("onnx::Shape_1066", "onnx::Shape_1108", "output.1")
"""Tensors (1, 85, rows, columns) of its own head at strides 8, 16 and 32: box, objectness and 80
classes."""

_ENTRY = "bgr"
_IR = 8


def frozen_part(source: ModelProto, outputs: tuple[str, ...] = (*FEATURES, *OWN)) -> ModelProto:
    """Cut a model off at `outputs`, for an input `images` (1, 3, *SIZE), RGB and from 0 to 1.

    `source` is Megvii's model, which takes BGR from 0 to 255, or a detector that was made of it.
    """
    whole = ModelProto()
    whole.CopyFrom(source)
    whole.ir_version = _IR
    _, _, rows, columns = whole.graph.input[0].type.tensor_type.shape.dim
    rows.dim_value, columns.dim_value = SIZE
    whole.graph.output[0].type.tensor_type.ClearField("shape")
    del whole.graph.value_info[:]
    known = {name for node in whole.graph.node for name in node.output}
    entry = _ENTRY if _ENTRY in known else whole.graph.input[0].name
    part = Extractor(infer_shapes(whole)).extract_model([entry], list(outputs))
    del part.metadata_props[:]
    part.graph.input[0].name = "images"
    for node in part.graph.node:
        node.input[:] = [_ENTRY if name == entry else name for name in node.input]
    order = numpy_helper.from_array(np.array([2, 1, 0]), "rgb_to_bgr")
    white = numpy_helper.from_array(np.array(255.0, np.float32), "white")
    part.graph.initializer.extend([order, white])
    part.graph.node.insert(0, helper.make_node("Mul", ["reversed", white.name], [_ENTRY]))
    part.graph.node.insert(
        0, helper.make_node("Gather", ["images", order.name], ["reversed"], axis=1)
    )
    return part


class FeatureExtractor:
    """Runs the frozen part on pictures."""

    def __init__(self, source: ModelProto, threads: int = 1) -> None:
        """Open a session on the frozen part of `source`."""
        content = frozen_part(source, tuple(FEATURES)).SerializeToString()
        self._session = open_session(content, "the frozen part", None, threads)

    def __call__(self, image: NDArray[np.uint8]) -> list[NDArray[np.float16]]:
        """Features (channels, rows, columns) of a BGR picture of `SIZE`, in the order of FEATURES.

        Half precision: a cache of them is read many times.
        """
        planes = np.ascontiguousarray(image[..., ::-1].transpose(2, 0, 1), np.float32)[None] / 255
        return [np.asarray(m, np.float16)[0] for m in self._session.run(None, {"images": planes})]

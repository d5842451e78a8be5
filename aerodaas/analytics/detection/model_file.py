"""Reader of ONNX files: inputs, outputs, metadata, and one trial run.

The file's name is not trusted. Every defect of a file is raised here, while the application is
built, as one ModelError that names the path and the remedy.
"""

from __future__ import annotations

import ast
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import onnxruntime as ort
from numpy.typing import NDArray

from aerodaas.analytics.models.cache import model_named, require_fetched
from aerodaas.errors import ModelError

__all__ = ["ModelFile", "PixelType", "Tensor", "read_model"]

PixelType: TypeAlias = np.float32 | np.float16 | np.uint8
"""Element types of an input: floating point in the family's range, or bytes from 0 to 255."""

_PIXELS: dict[str, type[PixelType]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
}
_PICTURE_AXES = 4
_COLOURS = 3
_FALLBACK_SIZE = 640
_STRIDE = 32
_ERRORS_ONLY, _NOTHING = 3, 4
_LONGEST_RUN = 60.0
"""Seconds for one picture in a trial; a network that flies takes less than one."""
_REMEDY = "export the model again, for example `yolo export model=yolo11n.pt format=onnx`"


@dataclass(frozen=True)
class Tensor:
    """An input or output as the file declares it; None in the shape denotes a variable axis."""

    name: str
    shape: tuple[int | None, ...]
    kind: str
    """Element type in onnxruntime's spelling, such as `tensor(float)`."""


@dataclass(frozen=True)
class ModelFile:
    """A model that onnxruntime can load and whose input is one colour image."""

    path: Path
    content: bytes
    input: Tensor
    outputs: tuple[Tensor, ...]
    metadata: dict[str, str]
    size: tuple[int, int]
    """Height and width of the input in pixels: declared, or chosen if variable."""
    session: ort.InferenceSession

    @property
    def dtype(self) -> type[PixelType]:
        """Element type of the input."""
        return _PIXELS[self.input.kind]

    @property
    def batches(self) -> bool:
        """Whether the batch size is variable."""
        return self.input.shape[0] is None

    @property
    def resizes(self) -> bool:
        """Whether the input's height and width are variable."""
        return None in self.input.shape[2:]

    @cached_property
    def trial(self) -> tuple[NDArray[np.float32], ...]:
        """Outputs for one mid-grey image, which show the shapes and scales of the outputs."""
        grey = 127 if self.dtype is np.uint8 else 0.5
        return self.run(np.full((1, _COLOURS, *self.size), grey, self.dtype))

    def run(self, pixels: NDArray[Any]) -> tuple[NDArray[np.float32], ...]:
        """Outputs, with their batch axes, for an input of the network.

        Raises:
            ModelError: If the network fails, gives something else than numbers, or takes longer
                than any that could fly: a stranger's may loop without end.
        """
        options = ort.RunOptions()
        options.log_severity_level = _NOTHING
        watch = threading.Timer(_LONGEST_RUN, setattr, (options, "terminate", True))
        watch.start()
        try:
            outputs = self.session.run(None, {self.input.name: pixels}, options)
            return tuple(np.asarray(output, np.float32) for output in outputs)
        except Exception as error:  # noqa: BLE001 - onnxruntime has no common base class
            if options.terminate:
                problem = f"takes more than {_LONGEST_RUN:g} s for one picture"
                raise self.refusal(problem, "choose a smaller model") from None
            raise self.refusal(f"fails on a trial picture ({_first_line(error)})") from None
        finally:
            watch.cancel()

    @property
    def output_shape(self) -> tuple[int, ...]:
        """Shape of the first output for one image: as declared, or by trial if variable."""
        declared = self.outputs[0].shape
        known = tuple(axis for axis in declared if axis is not None)
        return known if len(known) == len(declared) else self.trial[0].shape

    def literal(self, key: str) -> Any:  # noqa: ANN401 - of any type
        """One metadata value as a Python literal; None if it is missing or malformed."""
        return _literal(self.metadata.get(key))

    @property
    def names(self) -> tuple[str, ...] | None:
        """Class names from the metadata, by class number; None without any."""
        names = self.literal("names")
        if isinstance(names, dict) and set(names) == set(range(len(names))):
            names = [names[index] for index in range(len(names))]
        if not isinstance(names, list | tuple) or not names:
            return None
        return tuple(str(name) for name in names)

    def refusal(self, problem: str, remedy: str = _REMEDY) -> ModelError:
        """Make the error that names a problem of this file and its remedy.

        Args:
            problem: What is wrong; follows the file's name.
            remedy: What to do about it.
        """
        return _refusal(self.path, problem, remedy)


def read_model(path: str | Path, size: int | None = None) -> ModelFile:
    """Read and check an ONNX file, or a fetched model by its name.

    Args:
        path: The file, or a model's name.
        size: Side in pixels of the square input of a model of variable input size.

    Raises:
        ModelError: If the file is missing, empty, not an ONNX model, or does not take one colour
            image; if a model of this name was not fetched, or its file is another one.
        UnknownIdError: If no model has this name.
    """
    named = model_named(path)
    path = Path(path)
    content = _read(path) if named is None else require_fetched(named)
    options = ort.SessionOptions()
    options.log_severity_level = _ERRORS_ONLY
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    try:
        session = ort.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - onnxruntime has no common base class
        problem = f"cannot be loaded as an ONNX model ({_first_line(error)})"
        raise _refusal(path, problem, _REMEDY) from None
    try:
        metadata = dict(session.get_modelmeta().custom_metadata_map)
        inputs, outputs = _tensors(session.get_inputs()), _tensors(session.get_outputs())
    except UnicodeDecodeError:
        raise _refusal(path, "has names or metadata that are no text", _REMEDY) from None
    if not outputs:
        raise _refusal(path, "has no output", _REMEDY)
    if len(inputs) != 1:
        names = ", ".join(tensor.name for tensor in inputs) or "none"
        raise _refusal(path, f"must have one input, the picture, but has {names}", _REMEDY)
    _check_picture(path, inputs[0])
    return ModelFile(
        path=path,
        content=content,
        input=inputs[0],
        outputs=outputs,
        metadata=metadata,
        size=_input_size(path, inputs[0], metadata, size),
        session=session,
    )


def _read(path: Path) -> bytes:
    try:
        content = path.read_bytes()
    except OSError as error:
        remedy = "give the path of an .onnx file"
        raise _refusal(path, f"cannot be read ({error.strerror})", remedy) from None
    if not content:
        raise _refusal(path, "is empty", "copy or export it again")
    return content


def _tensors(nodes: Sequence[Any]) -> tuple[Tensor, ...]:
    return tuple(
        Tensor(
            node.name,
            tuple(axis if isinstance(axis, int) and axis > 0 else None for axis in node.shape),
            node.type,
        )
        for node in nodes
    )


def _check_picture(path: Path, tensor: Tensor) -> None:
    if tensor.kind not in _PIXELS:
        remedy = "export it with a float32, float16 or uint8 input"
        raise _refusal(path, f"takes {tensor.kind}, which are no pixels", remedy)
    if len(tensor.shape) != _PICTURE_AXES:
        problem = f"takes an input of {len(tensor.shape)} axes, not batch x 3 x height x width"
        raise _refusal(path, problem, "choose a model that takes pictures")
    batch, channels, *_ = tensor.shape
    if channels not in (_COLOURS, None):
        problem = f"takes pictures of {channels} channels where a camera gives 3"
        raise _refusal(path, problem, "train or export it for 3 colour channels, axes NCHW")
    if batch not in (1, None):
        problem = f"takes exactly {batch} pictures at once"
        raise _refusal(path, problem, "export it with batch=1 or dynamic=True")


def _input_size(
    path: Path, tensor: Tensor, metadata: dict[str, str], wanted: int | None
) -> tuple[int, int]:
    declared = tensor.shape[2:]
    if wanted is not None and (wanted < _STRIDE or wanted % _STRIDE):
        message = f"size must be a positive multiple of {_STRIDE} pixels, not {wanted}"
        raise ModelError(message)
    if wanted is not None and any(axis not in (None, wanted) for axis in declared):
        problem = f"has a fixed input of {declared[0]} x {declared[1]} pixels, not {wanted}"
        raise _refusal(path, problem, "leave size out, or export it with dynamic=True")
    trained = _literal(metadata.get("imgsz"))
    if wanted is not None or not _is_size(trained):
        side = wanted or _FALLBACK_SIZE
        trained = (side, side)
    return declared[0] or trained[0], declared[1] or trained[1]


def _is_size(value: object) -> bool:
    pair = 2
    return (
        isinstance(value, list | tuple)
        and len(value) == pair
        and all(isinstance(side, int) and side >= _STRIDE for side in value)
    )


def _literal(text: str | None) -> Any:  # noqa: ANN401 - of any type
    if text is None:
        return None
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return None


def _refusal(path: Path, problem: str, remedy: str) -> ModelError:
    return ModelError(f"the model {path} {problem}; {remedy}")


def _first_line(error: Exception) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__

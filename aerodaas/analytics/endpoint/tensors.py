"""Codec of the Open Inference Protocol (KServe v2): tensors as JSON, or binary after the JSON.

Source: the protocol's REST specification and its binary tensor data extension, as documented by
the KServe and Triton projects.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodaas.errors import EndpointError

__all__ = [
    "DATATYPES",
    "HEADER_LENGTH",
    "MALFORMED",
    "TensorSpec",
    "decode_reply",
    "encode_request",
]

HEADER_LENGTH = "Inference-Header-Content-Length"
"""HTTP header with the number of bytes of JSON before the binary data."""
DATATYPES: dict[str, type[np.generic]] = {
    "BOOL": np.bool_,
    "UINT8": np.uint8,
    "UINT16": np.uint16,
    "UINT32": np.uint32,
    "UINT64": np.uint64,
    "INT8": np.int8,
    "INT16": np.int16,
    "INT32": np.int32,
    "INT64": np.int64,
    "FP16": np.float16,
    "FP32": np.float32,
    "FP64": np.float64,
}
"""Element types by the protocol's names, except BYTES, which is not numeric."""
MALFORMED = (ValueError, KeyError, TypeError, AttributeError, RecursionError, OverflowError)
"""What reading a stranger's JSON of another form raises."""
_NAMES = {np.dtype(kind): name for name, kind in DATATYPES.items()}


@dataclass(frozen=True)
class TensorSpec:
    """An input or output of a model; None in the shape denotes a variable axis."""

    name: str
    datatype: str
    shape: tuple[int | None, ...]

    @classmethod
    def of(cls, name: str, kind: type[np.generic], shape: Sequence[int | None]) -> TensorSpec:
        """Create a spec from a numpy type.

        Args:
            name: Name of the tensor.
            kind: Element type.
            shape: Its dimensions; None for one of variable size.
        """
        return cls(name, _NAMES[np.dtype(kind)], tuple(shape))

    def fits(self, shape: Sequence[int | None]) -> bool:
        """Whether a tensor of `shape`, possibly with variable axes, is compatible."""
        pairs = zip(self.shape, shape, strict=False)
        same = len(self.shape) == len(shape)
        return same and all(None in pair or pair[0] == pair[1] for pair in pairs)

    def __str__(self) -> str:
        axes = " x ".join("?" if axis is None else str(axis) for axis in self.shape)
        return f"{self.name} ({self.datatype}, {axes})"


def encode_request(
    inputs: Mapping[str, NDArray[Any]], outputs: Sequence[str], *, binary: bool
) -> tuple[bytes, dict[str, str]]:
    """Encode a request for inference.

    Args:
        inputs: Arrays by name.
        outputs: Names of the outputs to be returned.
        binary: Send and request arrays as bytes; if False, as JSON.

    Returns:
        Body and headers of the request.
    """
    described, blocks = [], []
    for name, array in inputs.items():
        entry: dict[str, Any] = {
            "name": name,
            "shape": list(array.shape),
            "datatype": _NAMES[array.dtype],
        }
        if binary:
            blocks.append(np.ascontiguousarray(array).tobytes())
            entry["parameters"] = {"binary_data_size": len(blocks[-1])}
        else:
            entry["data"] = array.ravel().tolist()
        described.append(entry)
    wanted: list[dict[str, Any]] = [{"name": name} for name in outputs]
    for entry in wanted if binary else ():
        entry["parameters"] = {"binary_data": True}
    head = json.dumps({"inputs": described, "outputs": wanted}).encode()
    if not binary:
        return head, {"Content-Type": "application/json"}
    headers = {"Content-Type": "application/octet-stream", HEADER_LENGTH: str(len(head))}
    return b"".join([head, *blocks]), headers


def decode_reply(body: bytes, header_length: str | None) -> dict[str, NDArray[Any]]:
    """Decode the outputs of a reply.

    Args:
        body: Body of the reply.
        header_length: Bytes of JSON before the arrays, as the header says; None if all is JSON.

    Returns:
        Array of each output by name.

    Raises:
        EndpointError: For a malformed reply.
    """
    try:
        end = int(header_length) if header_length is not None else len(body)
        # A wrong length leaves invalid JSON or too little data, and so is detected.
        content = json.loads(body[: max(0, end)])
        found: dict[str, NDArray[Any]] = {}
        for output in content["outputs"]:
            kind = np.dtype(DATATYPES[output["datatype"]])
            size = (output.get("parameters") or {}).get("binary_data_size")
            if size is None:
                array = np.asarray(output["data"], kind)
            else:
                array = np.frombuffer(body[end : end + size], kind)
                end += size
            found[str(output["name"])] = array.reshape(output["shape"])
    except MALFORMED as error:
        text = str(error).partition("\n")[0]
        raise EndpointError(f"no reply of the inference protocol: {text}") from None
    return found

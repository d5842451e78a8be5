"""Creation of onnxruntime sessions: execution providers, threads and options."""

from __future__ import annotations

import logging
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import onnxruntime as ort

from aerodaas.errors import ModelError

__all__ = ["default_providers", "default_threads", "open_session"]

_log = logging.getLogger(__name__)
_PREFERRED = ("TensorrtExecutionProvider", "CUDAExecutionProvider", "CPUExecutionProvider")
_ERRORS_ONLY = 3
_ENGINES = Path.home() / ".cache" / "aerodaas" / "tensorrt"
# A TensorRT engine takes minutes to build and is cached for the next flight.
_OPTIONS: dict[str, dict[str, Any]] = {
    "TensorrtExecutionProvider": {
        "trt_fp16_enable": True,
        "trt_engine_cache_enable": True,
        "trt_engine_cache_path": str(_ENGINES),
    }
}


def default_threads() -> int:
    """Half of the cores available to this process, so that two models can share an edge node."""
    return max(1, len(os.sched_getaffinity(0)) // 2)


def default_providers() -> list[str]:
    """The execution providers that a session takes unless others are given, best first."""
    available = ort.get_available_providers()
    return [name for name in _PREFERRED if name in available]


def open_session(
    content: bytes, label: str, providers: Sequence[str] | None, threads: int | None
) -> ort.InferenceSession:
    """Create the session for a model, and log its execution provider.

    Args:
        content: Content of the ONNX file.
        label: Name of the model, for log and errors.
        providers: Names in onnxruntime's spelling, best first; None selects those available of
            TensorRT, CUDA and CPU.
        threads: Threads of one inference; None for the default.

    Raises:
        ModelError: If a provider is not installed, or the session cannot be created.
    """
    available = ort.get_available_providers()
    missing = [name for name in providers or () if name not in available]
    if missing:
        message = (
            f"{label}: onnxruntime here has no {', '.join(missing)}, only "
            f"{', '.join(available)}; install onnxruntime-gpu, or leave providers out"
        )
        raise ModelError(message)
    chosen = list(providers or default_providers())
    options = ort.SessionOptions()
    options.log_severity_level = _ERRORS_ONLY
    options.intra_op_num_threads = threads or default_threads()
    options.inter_op_num_threads = 1
    # Spinning threads would occupy cores that other nodes need.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    if "TensorrtExecutionProvider" in chosen:
        _ENGINES.mkdir(parents=True, exist_ok=True)
    try:
        session = ort.InferenceSession(
            content, options, providers=[(name, _OPTIONS.get(name, {})) for name in chosen]
        )
    except Exception as error:  # noqa: BLE001 - onnxruntime has no common base class
        raise ModelError(f"{label} cannot be started on {', '.join(chosen)}: {error}") from None
    used = session.get_providers()
    if used[0] != chosen[0]:
        _log.warning("%s: %s is not usable here, see onnxruntime's log", label, chosen[0])
    _log.info("%s runs on %s, %d threads", label, used[0], options.intra_op_num_threads)
    return session

"""Trial of a model that a user has brought: run once, in a process of bounded memory and time.

`python -m aerodaas.service.models.model_trial FILE`. A file of a kilobyte may ask for gigabytes,
and what runs it later is a flight. Whether it is a detector at all is for its mission to find out.
"""

from __future__ import annotations

import math
import resource
import subprocess
import sys
import threading
from pathlib import Path

from aerodaas.errors import ConfigError
from aerodaas.runtime.memory_limit import limit_memory
from aerodaas.service.flights.folder import service_free_environment

__all__ = ["try_model"]

_MOST_BYTES = 2 << 30
"""Memory of a model that runs; the largest that ship take a tenth of it."""
_MOST_DECLARED = 256 << 20
"""Bytes of one input or output by its declared shape."""
_MOST_SECONDS = 60
"""Of a processor, to load the model and run it once; and twice as many of the wall clock."""
_SIDE = 640
"""For an axis of variable length but the first, which is 1: as pictures' are when none is told."""
_BYTES = {"double": 8, "int64": 8, "uint64": 8, "float": 4, "int32": 4, "uint32": 4}
_TOO_MUCH = 3
"""Exit code of a trial that its model does not pass."""
_turn = threading.Semaphore(1)
"""One trial at a time, for each may take all the memory that it is allowed."""


def try_model(path: Path) -> None:
    """Raise ConfigError for a model that takes too much memory or time."""
    command = [sys.executable, "-m", "aerodaas.service.models.model_trial", str(path)]
    with _turn:
        try:
            done = subprocess.run(  # noqa: S603 - our own module
                command,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                env=service_free_environment(vehicles=False),
                timeout=2 * _MOST_SECONDS,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise ConfigError(_refusal(f"more than {2 * _MOST_SECONDS} s")) from None
    if done.returncode == _TOO_MUCH:
        raise ConfigError(_refusal(done.stdout.decode(errors="replace").strip()))
    if done.returncode < 0:
        # onnxruntime ends its process where memory lacks in a thread of its own.
        raise ConfigError(_refusal("more memory or time than a trial has"))


def _refusal(what: str) -> str:
    return f"the model takes {what} to be run once: choose a smaller one"


def _size(shape: list[object], kind: str) -> int:
    """Bytes of a tensor by what is declared of it."""
    count = math.prod(one for one in shape if isinstance(one, int) and one > 0)
    words = (size for name, size in _BYTES.items() if name in kind)
    return count * next(words, 1)


def _main(path: str) -> int:
    """Run the model of a file once; prints what it takes too much of."""
    import numpy as np  # noqa: PLC0415 - in the trial's process alone
    import onnxruntime as ort  # noqa: PLC0415 - as above

    resource.setrlimit(resource.RLIMIT_CPU, (_MOST_SECONDS, _MOST_SECONDS))
    limit_memory(_MOST_BYTES)
    options = ort.SessionOptions()
    options.log_severity_level = 4
    try:
        session = ort.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        inputs = session.get_inputs()
        for one in (*inputs, *session.get_outputs()):
            if (size := _size(one.shape, one.type)) > _MOST_DECLARED:
                print(f"{size >> 20} MiB for {one.name[:40]!r} alone")  # noqa: T201 - the answer
                return _TOO_MUCH
        fed = {}
        for one in inputs:
            axes = [1 if number == 0 else _SIDE for number in range(len(one.shape))]
            known = zip(one.shape, axes, strict=True)
            shape = [axis if isinstance(axis, int) and axis > 0 else side for axis, side in known]
            if math.prod(shape) > _MOST_DECLARED:
                return 0
            kind = one.type.removeprefix("tensor(").removesuffix(")")
            fed[one.name] = np.zeros(
                shape, {"float": "float32", "double": "float64"}.get(kind, kind)
            )
        session.run(None, fed)
    except MemoryError:
        print(f"more than {_MOST_BYTES >> 20} MiB")  # noqa: T201 - the answer
        return _TOO_MUCH
    except Exception as error:  # noqa: BLE001 - onnxruntime has no common base class
        if "alloc" in str(error).lower():
            print(f"more than {_MOST_BYTES >> 20} MiB")  # noqa: T201 - the answer
            return _TOO_MUCH
    return 0


if __name__ == "__main__":
    sys.exit(_main(sys.argv[1]))

"""Command `ray start` of a local Ray, without what one machine has no use for.

It is run as a script. Ray has no options for these; where its internals are not as expected, as in
another version, it starts as it would by itself.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from functools import partialmethod
from pathlib import Path
from typing import Any

__all__ = ["main"]

_MISSING = ("ray.serve.scripts", "grpc", "ray.dashboard.optional_deps")
"""Modules that `ray start` does without, as where they are not installed: a second of imports for
other subcommands, the proxy for remote drivers, and the web server of the node's agent."""
_HERE = Path(__file__).parent
_PROGRAM = "_build_python_executable_command_memory_profileable"
"""Ray's function for the first words of each of its programs."""


def main() -> None:
    """Be `ray start`, with this process' arguments."""
    with contextlib.suppress(ValueError):
        sys.path.remove(str(_HERE))  # its modules have no names of their own
    missing: dict[str, Any] = dict.fromkeys(_MISSING)
    sys.modules.update(missing)
    with contextlib.suppress(ImportError, AttributeError):
        _fork_workers()
        _stand_in_for_agent()
    importlib.import_module("ray.scripts.scripts").main()


def _fork_workers() -> None:
    """Have the node start workers by our launcher (`worker_launcher.py`)."""
    parameters: Any = importlib.import_module("ray._private.parameter").RayParams
    launcher = str(_HERE / "worker_launcher.py")
    parameters.__init__ = partialmethod(parameters.__init__, setup_worker_path=launcher)


def _stand_in_for_agent() -> None:
    """Have the node start our stand-in for its dashboard agent (`agent_stub.py`)."""
    services: Any = importlib.import_module("ray._private.services")
    constants: Any = importlib.import_module("ray._private.ray_constants")
    program = getattr(services, _PROGRAM)

    def words(process: str, *more: Any) -> list[str]:  # noqa: ANN401 - as Ray has it
        if process == constants.PROCESS_TYPE_DASHBOARD_AGENT:
            return [sys.executable, "-I", "-S", str(_HERE / "agent_stub.py")]
        found: list[str] = program(process, *more)
        return found

    setattr(services, _PROGRAM, words)


if __name__ == "__main__":
    main()

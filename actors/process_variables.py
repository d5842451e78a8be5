"""Environment variables of one actor's own process, which Ray does not learn.

Ray writes the variables of a `runtime_env` into a log that every user of the machine can read.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from pydantic import SecretStr

from aerodaas.config.model import RuntimeEnvConfig
from aerodaas.config.secrets import MAVLINK_KEY, is_secret_name

__all__ = [
    "ProcessVariables",
    "private_variables",
    "ray_variables",
    "vehicle_variables",
]

_AT_START = ("LD_", "PYTHON", "GLIBC_", "MALLOC_", "OMP_", "OPENBLAS_", "MKL_")
"""Prefixes of variables that loaders, interpreters and libraries read as a process starts."""


class ProcessVariables:
    """Variables that are set in the process in which this is unpickled.

    The first argument of a call: Ray unpickles arguments in order, so that what the later ones
    import finds the variables set.
    """

    def __init__(self, variables: Mapping[str, SecretStr]) -> None:
        """Take values by name."""
        self._variables = variables

    def __repr__(self) -> str:
        """Names alone."""
        return f"{type(self).__name__}({', '.join(self._variables)})"

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """Pickle it so that unpickling sets the variables."""
        return _arrived, ({name: one.get_secret_value() for name, one in self._variables.items()},)


def _arrived(variables: dict[str, str]) -> ProcessVariables:
    os.environ.update(variables)
    return ProcessVariables({})


def private_variables(env: RuntimeEnvConfig | None) -> dict[str, SecretStr]:
    """Variables of `env` that its process gets from us, with its analyses."""
    found = env.env_vars if env is not None else {}
    return {name: value for name, value in found.items() if not _at_start(name)}


def ray_variables(env: RuntimeEnvConfig) -> dict[str, str]:
    """Variables of `env` that must be there as its process starts, which Ray does in the open."""
    return {
        name: value.get_secret_value() for name, value in env.env_vars.items() if _at_start(name)
    }


def vehicle_variables() -> ProcessVariables:
    """This process' secrets of vehicles, for the actors that fly; a local Ray has none of them."""
    key = os.environ.get(MAVLINK_KEY, "")
    return ProcessVariables({MAVLINK_KEY: SecretStr(key)} if key else {})


def _at_start(name: str) -> bool:
    return name.startswith(_AT_START) and not is_secret_name(name)

"""Extras of the distribution: optional packages, and errors that name them."""

from __future__ import annotations

import importlib.util

from aerodaas.errors import ConfigError

__all__ = ["has_extra", "require_extra"]

_PACKAGES = {
    "agents": ("mcp",),
    "evaluation": ("pycocotools", "yaml"),
    "logs": ("pyulog",),
    "notebook": ("pandas",),
    "plots": ("matplotlib",),
    "remote": ("fastapi", "uvicorn", "websockets"),
    "service": ("fastapi", "jwt", "sqlalchemy", "uvicorn", "websockets"),
    "ros": ("rosbags",),
    "routing": ("pyvrp",),
    "terrain": ("tifffile", "imagecodecs"),
}
"""Packages to import, by extra."""


def has_extra(extra: str) -> bool:
    """Whether the packages of an extra, such as `plots` or `service`, are installed."""
    return all(importlib.util.find_spec(package) is not None for package in _PACKAGES[extra])


def require_extra(extra: str, purpose: str) -> None:
    """Require the packages of an extra.

    Args:
        extra: `agents`, `evaluation`, `logs`, `notebook`, `plots`, `remote`, `ros`, `routing`,
            `service` or `terrain`.
        purpose: The feature, as the subject of the error's sentence, in the singular.

    Raises:
        ConfigError: If a package is missing; says how to install it.
    """
    if not has_extra(extra):
        packages = ", ".join(_PACKAGES[extra])
        raise ConfigError(f"{purpose} needs {packages}: pip install 'aerodaas[{extra}]'")

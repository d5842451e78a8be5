"""Fetched models: their folder, and the way from a name to its file."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from aerodaas.analytics.models.registry import REGISTRY, RegisteredModel, registered
from aerodaas.errors import ModelError
from aerodaas.files.user_folders import cache_folder

__all__ = ["FOLDER_VARIABLE", "fetched_path", "model_folder", "model_named", "require_fetched"]

FOLDER_VARIABLE = "AERODAAS_MODELS"
"""Environment variable of the folder of fetched models."""


def model_folder() -> Path:
    """The folder of fetched models: `AERODAAS_MODELS`, or one in the user's cache."""
    named = os.environ.get(FOLDER_VARIABLE, "")
    return Path(named) if named else cache_folder() / "models"


def model_named(path: str | Path) -> RegisteredModel | None:
    """The registered model that is meant, or None for a file.

    A name is a text without a folder or a suffix; a file of such a name is given as `./name`.

    Raises:
        UnknownIdError: For a name that is neither registered nor a file.
    """
    name = str(path)
    if name in REGISTRY:
        return REGISTRY[name]
    plain = isinstance(path, str) and os.sep not in name and "." not in name
    if plain and not Path(name).exists():
        registered(name)
    return None


def fetched_path(model: RegisteredModel) -> Path:
    """Where the model lies once it is fetched."""
    return model_folder() / model.file


def require_fetched(model: RegisteredModel) -> bytes:
    """Read the model's file.

    Raises:
        ModelError: If it is not here, or is not the released file; says how to fetch it.
    """
    path = fetched_path(model)
    command = f"aerodaas models add {model.name}"
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise ModelError(
            f"the model {model.name} is not on this machine: fetch it once with `{command}` "
            f"({model.download / 1e6:.1f} MB, {model.licence})"
        ) from None
    except OSError as error:
        raise ModelError(f"the model {path} cannot be read ({error.strerror})") from None
    if hashlib.sha256(content).hexdigest() != model.sha256:
        raise ModelError(
            f"the model {path} is not the released {model.name} any more: fetch it again with "
            f"`{command}`"
        )
    return content

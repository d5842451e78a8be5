"""Models that users have brought: files named by their SHA-256."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
from collections.abc import Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any

from aerodaas.analytics.models import DETECTOR
from aerodaas.config.private_file import write_private
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.service.errors import RefusedError
from aerodaas.types.errors import ConfigError

__all__ = ["LARGEST_MODEL", "ModelShelf", "require_room"]

LARGEST_MODEL = 64 << 20
"""Bytes."""
_LEAST_FREE = 1 << 30
"""Bytes that stay free on the disk: flights under way are recorded there."""
_HASH = re.compile(r"[0-9a-f]{64}")


def require_room(folder: Path) -> None:
    """Raise RefusedError where the disk of `folder` has no room for another flight."""
    free = shutil.disk_usage(folder).free
    if free < _LEAST_FREE:
        raise RefusedError(
            int(HTTPStatus.INSUFFICIENT_STORAGE),
            f"the provider's disk has {free >> 20} MiB left: ask its operator to make room",
        )


class ModelShelf:
    """Folder of models."""

    def __init__(self, folder: Path) -> None:
        """Keep models in `folder`."""
        self._folder = folder
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._shipped = {
            hashlib.sha256(one.read_bytes()).hexdigest() for one in DETECTOR.parent.glob("*.onnx")
        }

    def has(self, sha256: str) -> bool:
        """Whether a model is here, brought or shipped."""
        return sha256 in self._shipped or self._path(sha256).is_file()

    def put(self, sha256: str, content: bytes) -> None:
        """Keep a model; raises ConfigError if it is too large or not the one that it is called."""
        if len(content) > LARGEST_MODEL:
            raise ConfigError(f"a model has at most {LARGEST_MODEL >> 20} MiB")
        if hashlib.sha256(content).hexdigest() != sha256:
            raise ConfigError("the content has another SHA-256 than its name")
        require_room(self._folder)
        write_private(self._path(sha256), content)

    def lend(self, document: MissionDocument, folder: Path) -> None:
        """Put the models of a document into `folder`; raises ConfigError for a missing one."""
        for sha256 in sorted(set(_named(document.model_dump()))):
            if not self.has(sha256):
                raise ConfigError(f"the model {sha256[:16]}… has not been sent: PUT /v1/models/…")
            if sha256 not in self._shipped:
                with contextlib.suppress(FileExistsError):
                    os.link(self._path(sha256), folder / f"{sha256}.onnx")

    def _path(self, sha256: str) -> Path:
        if not _HASH.fullmatch(sha256):
            raise ConfigError("a model is called by the SHA-256 of its file, 64 hexadecimal digits")
        return self._folder / f"{sha256}.onnx"


def _named(content: Any) -> Iterator[str]:  # noqa: ANN401 - a document's values
    """Hashes of all models that a document's values name."""
    if isinstance(content, dict):
        if "$model" in content and isinstance(content.get("sha256"), str):
            yield content["sha256"]
        for one in content.values():
            yield from _named(one)
    elif isinstance(content, list | tuple):
        for one in content:
            yield from _named(one)

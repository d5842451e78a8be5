"""Models that users have brought: files named by their SHA-256, each tenant's apart.

What nobody has used for long goes when its tenant has no room left: whoever needs it sends it anew,
which applications do by themselves. One that flies has a link to it of its own.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from http import HTTPStatus
from pathlib import Path
from typing import Any

from aerodaas.analytics.models import DETECTOR
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.errors import ConfigError
from aerodaas.files.private_file import write_private
from aerodaas.service.errors import RefusedError
from aerodaas.service.http.limits import RequestLimits

__all__ = ["ModelStore", "require_room"]

_LEAST_FREE = 1 << 30
"""Bytes that stay free on the disk: flights under way are recorded there."""
_LARGEST_SHELF = 2 << 30
"""Bytes of one tenant's models."""
_KEPT_SECONDS = 86400.0
"""Seconds for which a model stays after its last use: a mission that waits may name it."""
_HASH = re.compile(r"[0-9a-f]{64}")


def require_room(folder: Path) -> None:
    """Raise RefusedError where the disk of `folder` has no room for another flight."""
    free = shutil.disk_usage(folder).free
    if free < _LEAST_FREE:
        raise RefusedError(
            int(HTTPStatus.INSUFFICIENT_STORAGE),
            f"the provider's disk has {free >> 20} MiB left: ask its operator to make room",
        )


class ModelStore:
    """Folder of models."""

    def __init__(self, folder: Path, trial: Callable[[Path], None] = lambda _: None) -> None:
        """Keep models in `folder` that pass a `trial`, which raises AeroDaaSError of others."""
        self._trial = trial
        self._folder = folder
        self._lock = threading.Lock()
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._shipped = {
            hashlib.sha256(one.read_bytes()).hexdigest() for one in DETECTOR.parent.glob("*.onnx")
        }

    def has(self, tenant: str, sha256: str) -> bool:
        """Whether a tenant has a model here, brought or shipped; one that is asked for is used.

        Args:
            tenant: Name of the tenant.
            sha256: SHA-256 of the model, hexadecimal.
        """
        path = self._path(tenant, sha256)
        if sha256 in self._shipped:
            return True
        try:
            os.utime(path)
        except FileNotFoundError:
            return False
        return True

    def put(self, tenant: str, sha256: str, content: bytes) -> None:
        """Keep a tenant's model, for which its longest unused ones go if need be.

        Args:
            tenant: Name of the tenant.
            sha256: SHA-256 of the model, hexadecimal.
            content: The ONNX file.

        Raises:
            ConfigError: If it is too large or not the one that it is called, or takes too much to
                be run.
            RefusedError: If there is no room.
        """
        if len(content) > RequestLimits.model_bytes:
            raise ConfigError(f"a model has at most {RequestLimits.model_bytes >> 20} MiB")
        if hashlib.sha256(content).hexdigest() != sha256:
            raise ConfigError("the content has another SHA-256 than its name")
        if self.has(tenant, sha256):
            return
        require_room(self._folder)
        path = self._path(tenant, sha256)
        with self._lock:
            path.parent.mkdir(exist_ok=True, mode=0o700)
        with tempfile.TemporaryDirectory(dir=self._folder, prefix=".") as tried:
            file = Path(tried) / path.name
            write_private(file, content)
            self._trial(file)
        with self._lock:
            _make_room(path.parent, len(content), tenant)
            write_private(path, content)

    def link_models(self, tenant: str, document: MissionDocument, folder: Path) -> None:
        """Put a tenant's models into `folder` as its document names them.

        Args:
            tenant: Name of the tenant.
            document: The mission document.
            folder: Folder of a flight's models.

        Raises:
            ConfigError: If a model is missing.
        """
        for sha256 in sorted(set(_named(document.model_dump()))):
            if not self.has(tenant, sha256):
                raise ConfigError(f"the model {sha256[:16]}… has not been sent: PUT /v1/models/…")
            if sha256 not in self._shipped:
                with contextlib.suppress(FileExistsError):
                    os.link(self._path(tenant, sha256), folder / f"{sha256}.onnx")

    def _path(self, tenant: str, sha256: str) -> Path:
        if not _HASH.fullmatch(sha256):
            raise ConfigError("a model is called by the SHA-256 of its file, 64 hexadecimal digits")
        return self._folder / tenant / f"{sha256}.onnx"


def _make_room(folder: Path, size: int, tenant: str) -> None:
    """Remove models from a tenant's `folder` until `size` bytes more fit."""
    known = sorted((one.stat().st_mtime, one.stat().st_size, one) for one in folder.iterdir())
    left = _LARGEST_SHELF - size - sum(bytes_ for _, bytes_, _ in known)
    for used, bytes_, path in known:
        if left >= 0 or time.time() - used < _KEPT_SECONDS:
            break
        path.unlink()
        left += bytes_
    if left < 0:
        raise RefusedError(
            int(HTTPStatus.INSUFFICIENT_STORAGE),
            f"the models of {tenant} fill the {_LARGEST_SHELF >> 30} GiB that it has: the next "
            "one has room once one has been without use for a day",
        )


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

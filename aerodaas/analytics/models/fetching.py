"""Fetching of released models: whole and with the right checksum, or not at all.

Nothing is fetched but by `fetch_model`, which `aerodaas models add` calls. What arrives is kept
beside its place until its checksum is right, and goes on from there after an interruption; nothing
reads it before. So neither the network nor a mirror need be trusted.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import ssl
import zipfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from http import HTTPStatus
from pathlib import Path, PurePosixPath
from typing import IO
from urllib.parse import urlsplit

import httpx

from aerodaas.analytics.models.cache import fetched_path, require_fetched
from aerodaas.analytics.models.registry import RegisteredModel, registered
from aerodaas.errors import ConfigError, ModelError, SourceError
from aerodaas.http_client import http_client, http_errors
from aerodaas.text.printable import printable

__all__ = ["fetch_model"]

_CHUNK = 1 << 16
_SILENCE = 20.0
"""Seconds without a byte after which a server is given up."""
_AGENT = "aerodaas-models"

Progress = Callable[[int, int], None]
"""Called with the bytes that are there, and all of them."""


def fetch_model(
    name: str, source: str | None = None, *, progress: Progress = lambda _done, _all: None
) -> Path:
    """Put a registered model among the fetched ones; one that is there already stays.

    Args:
        name: Of the model.
        source: Another place than its release: an address of the file, or of a folder with it
            (which ends in a slash), or a file on this machine.
        progress: Called while it arrives.

    Returns:
        The model's file.

    Raises:
        UnknownIdError: If there is no such model.
        SourceError: If it cannot be had from there; what has arrived goes on next time.
        ModelError: If what arrived is another file; nothing of it is kept.
        ConfigError: If the source is malformed, the folder cannot be written, or another process
            fetches the model.
    """
    model = registered(name)
    target = fetched_path(model)
    if _is_there(model):
        return target
    part = target.with_name(f"{Path(urlsplit(model.address).path).name}.part")
    try:
        target.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        with _alone(part, name) as file:
            _receive(file, model, source, progress)
            _check(file, part, model.archive.sha256 if model.archive else model.sha256, name)
            if model.archive is not None:
                _unpack(file, part, model, model.archive.member)
            part.replace(target)
    except OSError as error:
        raise ConfigError(f"cannot write into {target.parent}: {error.strerror}") from None
    return target


def _is_there(model: RegisteredModel) -> bool:
    try:
        require_fetched(model)
    except ModelError:
        return False
    return True


@contextmanager
def _alone(part: Path, name: str) -> Iterator[IO[bytes]]:
    """The file of what has arrived, for one process at a time."""
    with part.open("a+b") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ConfigError(f"another process is fetching {name}: wait for it") from None
        yield file


def _receive(
    file: IO[bytes], model: RegisteredModel, source: str | None, progress: Progress
) -> None:
    """Append what is missing to `file`."""
    size = model.download
    have = file.seek(0, os.SEEK_END)
    if have > size:
        have = file.truncate(0)
    if have == size:
        return
    where = source or model.address
    is_local = source is not None and Path(source).is_file()
    opened = _opened(Path(where)) if is_local else _asked(_address(model, source), have)
    with opened as (start, chunks):
        done = file.truncate(start)
        progress(done, size)
        for chunk in chunks:
            done += len(chunk)
            if done > size:
                break
            file.write(chunk)
            progress(done, size)
    file.flush()
    if done > size or (done < size and is_local):
        file.truncate(0)
        longer = "longer" if done > size else "shorter"
        raise ModelError(
            f"{where} is {longer} than {model.name} ({size} bytes): it is another file"
        )
    if done < size:
        raise SourceError(
            f"{model.name} was cut off after {done} of {size} bytes: the same command goes on there"
        )


def _address(model: RegisteredModel, source: str | None) -> str:
    address = source or model.address
    parts = urlsplit(address)
    if parts.scheme not in ("http", "https") or not parts.hostname:
        raise ConfigError(
            f"{printable(address)} is neither a file nor an address of the form https://…"
        )
    if not parts.path.endswith("/"):
        return address
    return address + Path(urlsplit(model.address).path).name


@contextmanager
def _opened(path: Path) -> Iterator[tuple[int, Iterator[bytes]]]:
    """A file on this machine from its beginning, in chunks."""
    with path.open("rb") as file:
        yield 0, iter(lambda: file.read(_CHUNK), b"")


@contextmanager
def _asked(address: str, have: int) -> Iterator[tuple[int, Iterator[bytes]]]:
    """The answer of a server: the byte at which it begins, `have` or 0, and its chunks."""
    headers = {"User-Agent": _AGENT} | ({"Range": f"bytes={have}-"} if have else {})
    tls = ssl.create_default_context()
    with http_client(_SILENCE, tls=tls, public=True) as client, ExitStack() as stack:
        with http_errors(lambda error: _unreachable(address, error)):
            answer = stack.enter_context(client.stream("GET", address, headers=headers))
        if not answer.is_success:
            raise SourceError(f"{address} answers with status {answer.status_code}")
        partial = answer.status_code == HTTPStatus.PARTIAL_CONTENT
        begins = answer.headers.get("Content-Range", "").startswith(f"bytes {have}-")
        yield have if partial and begins else 0, _chunks(answer)


def _unreachable(address: str, error: Exception) -> SourceError:
    return SourceError(
        f"{address} cannot be reached: {printable(str(error))}; --from takes a mirror, or a file "
        "that was fetched elsewhere"
    )


def _chunks(answer: httpx.Response) -> Iterator[bytes]:
    """All chunks; what is cut off ends early, which its length tells."""
    with suppress(httpx.HTTPError):
        yield from answer.iter_raw()


def _check(file: IO[bytes], part: Path, wanted: str, name: str) -> None:
    """Require a checksum; another file is removed."""
    file.seek(0)
    digest = hashlib.sha256()
    while chunk := file.read(_CHUNK):
        digest.update(chunk)
    found = digest.hexdigest()
    if found != wanted:
        part.unlink()
        raise ModelError(
            f"what arrived is not {name}: its SHA-256 is {found}, not {wanted}; nothing of it was "
            "kept"
        )


def _unpack(file: IO[bytes], part: Path, model: RegisteredModel, member: str) -> None:
    """Put the model in its archive's place, and require its checksum."""
    try:
        with zipfile.ZipFile(file) as archive:
            (name,) = (one for one in archive.namelist() if PurePosixPath(one).name == member)
            with archive.open(name) as packed:
                content = packed.read(model.size + 1)
    except (zipfile.BadZipFile, ValueError) as error:
        part.unlink()
        raise ModelError(f"the archive of {model.name} is damaged: {error}") from None
    file.truncate(0)
    file.write(content)
    file.flush()
    _check(file, part, model.sha256, model.name)

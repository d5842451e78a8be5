"""Submission of a mission: the models that the provider lacks, and the document."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from aerodaas.config.options import RunOptions
from aerodaas.dataflow.mission_document import MissionDocument
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import ConfigError, UnreachableError
from aerodaas.protocol.schemas import MissionIn, MissionOut

__all__ = ["submit"]


def submit(
    client: ProviderClient,
    document: MissionDocument,
    models: Mapping[str, Path],
    options: RunOptions,
    step: Callable[[str], None] = lambda _: None,
) -> MissionOut:
    """Submit a document as `options` have it.

    Args:
        client: Of the provider.
        document: What is to be flown.
        models: Files of the models that it names, by SHA-256.
        options: Of the run.
        step: Told of what is being sent.

    Raises:
        ConfigError: For a model that cannot be read, and for what the provider refuses.
        MissionError: For what it cannot fulfil now.
        UnreachableError: If it does not answer.
    """
    for sha256, path in models.items():
        if not client.has_model(sha256):
            step(f"sending {path.name}")
            client.put_model(_content(path))
    step("submitting")
    try:
        return client.submit(_order(document, options))
    except UnreachableError as error:
        raise UnreachableError(
            f"{error}; the mission may have arrived all the same: `aerodaas missions list` tells"
        ) from None


def _order(document: MissionDocument, options: RunOptions) -> MissionIn:
    wanted = options.provider
    given: dict[str, Any] = {
        "minutes": wanted.minutes,
        "lease": wanted.lease,
        "silence": wanted.silence,
        "silence_seconds": wanted.silence_seconds,
        "attach": wanted.attach,
        "share": list(wanted.share),
        "grants": dict(map(_granted, wanted.grant)),
        "seed": options.seed,
    }
    content = {name: value for name, value in given.items() if value is not None}
    return MissionIn(document=document, **content)


def _granted(text: str) -> tuple[str, list[str]]:
    """Tenant and cameras of `TENANT`, or `TENANT=SENSOR,…`."""
    tenant, _, sensors = text.partition("=")
    return tenant, [one.strip() for one in sensors.split(",") if one.strip()]


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ConfigError(f"cannot read the model {path}: {error.strerror}") from None

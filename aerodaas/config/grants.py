"""Grants and quotas of a guest application: what its owner lets it have, and how much."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from aerodaas.config.checked import near
from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.redaction import redacted
from aerodaas.errors import ConfigError

__all__ = ["Catalogue", "GuestGrants", "GuestQuota", "parse_grants", "parse_words", "reduced"]

_RIGHTS = ("sense", "compute", "fly")


@dataclass(frozen=True)
class GuestQuota:
    """Most of each thing that one guest may use."""

    analyses: int = 4
    memory: int = 2048
    """Megabytes of private memory of its process."""
    rate: int = 20
    """Hz of a source of its own."""


@dataclass(frozen=True)
class GuestGrants:
    """Rights of one guest, by id; empty for none."""

    sense: frozenset[str] = frozenset()
    """Full ids of sensors."""
    compute: frozenset[str] = frozenset()
    fly: frozenset[str] = frozenset()
    """Robots that it may navigate, pause and land."""
    quota: GuestQuota = field(default_factory=GuestQuota)


@dataclass(frozen=True)
class Catalogue:
    """All that a guest is told of its owner's environment."""

    guest: str
    config: EnvironmentConfig
    grants: GuestGrants


def parse_grants(words: Iterable[str], config: EnvironmentConfig, guest: str) -> GuestGrants:
    """Read the rights of the guest called `guest`, such as `sense:cam1`, `compute` or `memory:512`.

    A right without an id is for all of its kind. Raises ConfigError for an unknown right or id.
    """
    grants = GuestGrants()
    for word in words:
        right, _, name = word.partition(":")
        if right in vars(grants.quota):
            grants = replace(grants, quota=_quota(grants.quota, right, name, word))
        elif right in _RIGHTS:
            ids = _ids(config, right, name, f"--grant {guest}={word}")
            grants = replace(grants, **{right: getattr(grants, right) | ids})
        else:
            known = [*_RIGHTS, *vars(grants.quota)]
            raise ConfigError(f"--grant {guest}={word}: there is no right{near(right, known)}")
    return grants


def parse_words(texts: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Read `--grant` of the command line, `GUEST=RIGHT,…`, by guest; raises ConfigError."""
    found: dict[str, tuple[str, ...]] = {}
    for text in texts:
        guest, equals, rights = text.partition("=")
        if not equals or not guest or not rights:
            raise ConfigError(
                f"--grant takes GUEST=RIGHT,…, such as theirs=sense:cam1,compute, not {text!r}"
            )
        words = [word.strip() for word in rights.split(",") if word.strip()]
        found[guest] = (*found.get(guest, ()), *words)
    return found


def _quota(quota: GuestQuota, name: str, text: str, word: str) -> GuestQuota:
    if not text.isdecimal() or int(text) < 1:
        raise ConfigError(f"--grant …={word}: {name} takes a whole number, as in {name}:8")
    return replace(quota, **{name: int(text)})


def _ids(config: EnvironmentConfig, right: str, name: str, place: str) -> frozenset[str]:
    if right == "sense":
        sensors = config.all_sensors()
        known = {one.full_id: {one.full_id, one.id, one.robot or ""} for one in sensors}
    elif right == "fly":
        known = {robot.id: {robot.id} for robot in config.robots}
    elif config.compute == "auto":
        known = {kind: {kind} for kind in ("edge",)}
    else:
        known = {one.id: {one.id} for one in config.compute if one.kind == "edge"}
    fitting = frozenset(full for full, names in known.items() if not name or name in names)
    if not fitting:
        raise ConfigError(f"{place}: there is nothing of that name{near(name, known)}")
    return fitting


def reduced(config: EnvironmentConfig, grants: GuestGrants) -> EnvironmentConfig:
    """The part of an environment that a guest may know.

    Without addresses, paths, drivers' settings, secrets, and what is not granted. All robots keep
    their ids, so that a guest can name one that it was not granted and be told so.
    """
    compute = [{"id": name, "kind": "edge"} for name in sorted(grants.compute)]
    return redacted(config, sensors=grants.sense, compute=compute)

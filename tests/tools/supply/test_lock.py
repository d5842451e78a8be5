"""The hash-locked test environment is in step with what pyproject.toml asks for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

_ROOT = Path(__file__).resolve().parents[3]
_PROJECT = ProjectMetadata(str(_ROOT), PluginManager()).core
_REMEDY = "run `make lock`"


def _locked(text: str) -> list[tuple[Requirement, int]]:
    """Each pin, with its number of hashes."""
    entries = re.sub(r"^#.*\n", "", text, flags=re.MULTILINE).replace("\\\n", " ").splitlines()
    return [
        (Requirement(entry.partition("--hash")[0]), entry.count("--hash=sha256:"))
        for entry in entries
        if entry.strip()
    ]


def _asked() -> list[Requirement]:
    """What development needs; extras that name other extras are resolved by the build backend."""
    lines = [*_PROJECT.dependencies, *_PROJECT.optional_dependencies["dev"]]
    return [Requirement(line) for line in lines]


_LOCK = (_ROOT / "requirements-dev.txt").read_text(encoding="utf-8")


@pytest.mark.parametrize("machine", ["x86_64", "aarch64"])
@pytest.mark.parametrize("python", ["3.10.13", "3.11.7", "3.12.1", "3.13.0"])
def test_each_requirement_is_locked_once_at_a_version_that_is_allowed(
    python: str, machine: str
) -> None:
    """For every Python and processor that the project runs on."""
    place: dict[str, str] = {
        **{key: str(value) for key, value in default_environment().items()},
        "python_version": python.rpartition(".")[0],
        "python_full_version": python,
        "platform_machine": machine,
        "extra": "",
    }
    here = [pin for pin, _ in _locked(_LOCK) if pin.marker is None or pin.marker.evaluate(place)]
    pins = {canonicalize_name(pin.name): pin for pin in here}
    assert len(here) == len(pins)
    assert {"ray", "fastapi", "ruff"} <= {wanted.name for wanted in _asked()}
    for wanted in _asked():
        if wanted.marker is None or wanted.marker.evaluate(place):
            assert canonicalize_name(wanted.name) in pins, f"{wanted} is not locked: {_REMEDY}"
            (version,) = pins[canonicalize_name(wanted.name)].specifier
            assert version.version in wanted.specifier, f"{wanted}, not {version}: {_REMEDY}"


def test_every_file_is_known_by_its_hash_and_none_by_an_address() -> None:
    """One without a hash would be taken from wherever the name leads."""
    pins = _locked(_LOCK)
    assert len(pins) > 100
    assert not [str(pin) for pin, hashes in pins if not hashes]
    assert not [str(pin) for pin, _ in pins if [one.operator for one in pin.specifier] != ["=="]]
    assert "://" not in _LOCK

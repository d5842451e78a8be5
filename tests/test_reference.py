"""The API reference: built without a warning, and whole."""

from __future__ import annotations

import doctest
import importlib
import os
import subprocess
import sys
import zlib
from collections.abc import Mapping
from pathlib import Path

import pytest

import aerodaas
import aerodaas.analytics

_ROOT = Path(__file__).parents[1]


def _with_examples() -> list[str]:
    """Modules whose docstrings hold examples."""
    files = [
        path.relative_to(_ROOT)
        for root in ("aerodaas", "actors", "schedulers")
        for path in (_ROOT / root).rglob("*.py")
        if ">>> " in path.read_text(encoding="utf-8")
    ]
    names = {".".join(path.with_suffix("").parts) for path in files}
    return sorted(n if n.startswith("aerodaas.") else f"aerodaas.{n}" for n in names)


@pytest.fixture(scope="module")
def inventory(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, str]:
    """Pages of the built site by the full names of what they document."""
    site = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "-d", str(site)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(
        command, cwd=_ROOT, env=environment, capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    # Sphinx's inventory: four lines of header, then one compressed line for each object.
    content = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    lines = zlib.decompress(content).decode().splitlines()
    return {line.split()[0]: line.split()[3] for line in lines}


@pytest.mark.parametrize("package", [aerodaas, aerodaas.analytics], ids=lambda one: one.__name__)
def test_all_that_an_application_imports_is_documented(
    package: object, inventory: Mapping[str, str]
) -> None:
    """Each public name stands on a page, under the name of the module that defines it."""
    names: list[str] = getattr(package, "__all__")  # noqa: B009 - of any module
    objects = [getattr(package, name) for name in names]
    full = {f"{one.__module__}.{one.__qualname__}" for one in objects}
    assert len(full) > 15
    assert full - inventory.keys() == set()


@pytest.mark.parametrize("module", _with_examples())
def test_examples_in_docstrings_come_out_as_printed(module: str) -> None:
    """Whoever copies one into an interpreter gets what it says."""
    assert doctest.testmod(importlib.import_module(module)).failed == 0

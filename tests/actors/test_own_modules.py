"""The modules that a run brings along: the application's own, and nothing that is installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from aerodaas.actors.run.own_modules import is_installed, own_modules

FILES = {
    "first.py": "import json, numpy\nimport second\n",
    "second.py": "def late():\n    from package.part import value\n    return value\n",
    "package/__init__.py": "",
    "package/part.py": "from . import other\nimport third.deep\n",
    "package/other.py": "import broken_syntax\n",
    "broken_syntax.py": "def (:\n",
    "third/deep.py": "",
    "unused.py": "",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """An application's folder."""
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_what_is_imported_comes_along(folder: Path) -> None:
    """Also in a function, by a part of a package, of a folder without a file; and no more."""
    found = own_modules(["first"], [str(folder)])
    names = ("first.py", "second.py", "package", "broken_syntax.py", "third")
    assert set(found.values()) == {folder / name for name in names}
    assert found["third"] == folder / "third"


def test_what_is_everywhere_stays(folder: Path) -> None:
    """Python's own, the project's, and what is installed."""
    assert (
        own_modules(["json", "numpy", "aerodaas.messages", "ray", "no_such_module"], [str(folder)])
        == {}
    )
    assert is_installed("pytest")
    assert not is_installed("no_such_module")

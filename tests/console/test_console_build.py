"""What ships of the console is what its source gives."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from required import needs_peer, peer

from tools.wire_schema import SCHEMA, schema_text

_ROOT = Path(__file__).resolve().parents[2]
_SOURCE = _ROOT / "console"
_PAGE = _ROOT / "aerodaas" / "console" / "page"


def test_the_wires_types_are_the_services() -> None:
    """The schema from which the page's types are made is that of the present models."""
    assert SCHEMA.read_text(encoding="utf-8") == schema_text(), "run: make console"


def test_the_page_asks_nobody_else() -> None:
    """Neither scripts, styles nor fonts of another host."""
    for path in _PAGE.glob("*.[hcj]*"):
        text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")
        assert "http://" not in text, path
        assert "https://" not in text, path


@pytest.mark.slow
@needs_peer("AERODAAS_NPM")
def test_the_page_that_ships_is_built_from_its_source(tmp_path: Path) -> None:
    """To the last byte, with exactly the packages that are locked."""
    copy = tmp_path / "console"
    shutil.copytree(_SOURCE, copy, ignore=shutil.ignore_patterns("node_modules"))
    npm = peer("AERODAAS_NPM")
    for words in (["ci", "--ignore-scripts", "--no-audit", "--no-fund"], ["run", "build"]):
        done = subprocess.run([npm, *words], cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    built = tmp_path / "aerodaas" / "console" / "page"
    assert {one.name for one in built.iterdir()} == {one.name for one in _PAGE.iterdir()}
    for one in built.iterdir():
        assert one.read_bytes() == (_PAGE / one.name).read_bytes(), f"{one.name}: make console"
    types = Path("src") / "wire.ts"
    assert (copy / types).read_bytes() == (_SOURCE / types).read_bytes(), "make console"

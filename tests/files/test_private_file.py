"""Files that their owner alone may read."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from aerodaas.files.private_file import write_private


@pytest.mark.parametrize("content", ["tökens\n", b"\x00\xff"], ids=["text", "bytes"])
def test_only_its_owner_reads_it(tmp_path: Path, content: str | bytes) -> None:
    """Also where an earlier file was open to others."""
    path = tmp_path / "secret"
    path.write_text("former")
    path.chmod(0o644)
    write_private(path, content)
    assert path.read_bytes() == (content.encode() if isinstance(content, str) else content)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    """Nothing of the new file stays behind."""
    path = tmp_path / "taken"
    path.mkdir()
    (path / "former").touch()
    with pytest.raises(OSError, match="taken"):
        write_private(path, "new")
    assert [one.name for one in tmp_path.rglob("*")] == ["taken", "former"]

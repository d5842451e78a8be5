"""The folder of one user in a place that all users share."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from required import needs_root

from aerodaas.actors.private_folder import private_folder
from aerodaas.errors import AeroDaaSError


def top(base: Path) -> Path:
    """This user's folder."""
    return base / f"aerodaas-{os.geteuid()}"


def test_is_made_for_this_user_alone(tmp_path: Path) -> None:
    """Whatever the umask."""
    before = os.umask(0)
    try:
        folder = private_folder("streams", str(tmp_path))
    finally:
        os.umask(before)
    assert folder == top(tmp_path) / "streams"
    for one in (folder, folder.parent):
        assert stat.S_IMODE(one.stat().st_mode) == 0o700
    assert private_folder("streams", str(tmp_path)) == folder


def test_a_link_is_refused(tmp_path: Path) -> None:
    """It leads where another user wants us to write."""
    (tmp_path / "elsewhere").mkdir()
    top(tmp_path).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(AeroDaaSError, match=r"is a link or file .* sudo rm -r "):
        private_folder("streams", str(tmp_path))
    assert list((tmp_path / "elsewhere").iterdir()) == []


def test_a_dangling_link_is_refused(tmp_path: Path) -> None:
    """And nothing is made at its end."""
    top(tmp_path).symlink_to(tmp_path / "elsewhere")
    with pytest.raises(AeroDaaSError, match="is a link or file"):
        private_folder("streams", str(tmp_path))
    assert not (tmp_path / "elsewhere").exists()


@needs_root
@pytest.mark.parametrize("inner", [False, True])
def test_a_folder_of_another_user_is_refused(tmp_path: Path, *, inner: bool) -> None:
    """Its owner could read and exchange all in it."""
    planted = top(tmp_path) / "streams" if inner else top(tmp_path)
    planted.mkdir(0o700, parents=True)
    planted.parent.chmod(0o700)
    os.chown(planted, 65534, 65534)
    with pytest.raises(AeroDaaSError, match="is a folder of user 65534, not a folder of our own"):
        private_folder("streams", str(tmp_path))


def test_our_own_is_closed_to_others(tmp_path: Path) -> None:
    """With a warning."""
    top(tmp_path).mkdir()
    top(tmp_path).chmod(0o777)
    with pytest.warns(UserWarning, match="was open to other users"):
        private_folder("streams", str(tmp_path))
    assert stat.S_IMODE(top(tmp_path).stat().st_mode) == 0o700

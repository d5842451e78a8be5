"""Folder of one user of this machine in `/tmp`, which no other user can enter."""

from __future__ import annotations

import os
import stat
import warnings
from pathlib import Path

from aerodaas.errors import AeroDaaSError

__all__ = ["private_folder"]

_BASE = "/tmp"  # noqa: S108 - all processes of a user must find it, whatever their TMPDIR
_OTHERS = stat.S_IRWXG | stat.S_IRWXO


def private_folder(name: str, base: str = _BASE) -> Path:
    """Return this user's folder `aerodaas-UID/name` in `base`, made with mode 0700 if missing.

    Rights of others on a folder of our own are taken away, with a warning.

    Args:
        name: Name of the folder.
        base: Folder for all users.

    Raises:
        AeroDaaSError: If the path is a link or belongs to another user: anybody may have put it
            there.
    """
    top = Path(base, f"aerodaas-{os.geteuid()}")
    _own(top)
    _own(top / name)
    return top / name


def _own(path: Path) -> None:
    try:
        path.mkdir(mode=0o700)
    except FileExistsError:
        pass
    except OSError as error:
        raise AeroDaaSError(f"cannot make the folder {path}: {error.strerror}") from None
    found = path.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        kind = "folder" if stat.S_ISDIR(found.st_mode) else "link or file"
        raise AeroDaaSError(
            f"{path} is a {kind} of user {found.st_uid}, not a folder of our own (user "
            f"{os.geteuid()}), and is not used; remove it: sudo rm -r {path}"
        )
    if found.st_mode & _OTHERS:
        # It is ours and no link, and `/tmp` is sticky: nobody else can have exchanged it since.
        path.chmod(0o700)
        warnings.warn(f"{path} was open to other users; it is closed now", stacklevel=3)

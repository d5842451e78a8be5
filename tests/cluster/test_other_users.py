"""Two users of one machine: each can run, and neither reaches what is the other's."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from required import needs, needs_root

from aerodaas.actors.streams import shared_memory_available

ROOT = Path(__file__).resolve().parents[2]
UID = 64_018
"""A user of whom this machine has not heard."""
pytestmark = needs_root

_STREAM = """
import numpy as np
from aerodaas.actors.streams import Publisher, Subscriber, shared_memory_obstacle
from aerodaas.runtime.node import Outlet
from aerodaas.messages.frames import Header
print(shared_memory_obstacle() or "available")
if not shared_memory_obstacle():
    subscriber = Subscriber("of-a-second-user", {"frames": 4})
    publisher = Publisher("of-a-second-user", "frames")
    publisher.publish(Outlet("frames").measure(np.zeros(100_000), Header(0, 0, "camera"), 0))
    assert len(subscriber.receive(5.0)) == 1
"""
_RUN = """
import os, stat
from pathlib import Path
from aerodaas.actors.cluster import ray_cluster
import ray
ray_cluster.connect(None)
print(ray.get(ray.remote(lambda: os.getuid()).remote()))
print(oct(stat.S_IMODE((Path.home() / ".ray/auth_token").stat().st_mode)))
ray_cluster.disconnect()
"""
_JOIN = """
import sys
from aerodaas.actors.cluster.handshake import greet
greet(sys.argv[1])
"""


class SecondUser:
    """Runs Python as another user, in a mount namespace where the interpreter can be read."""

    def __init__(self, folder: Path) -> None:
        self.home = folder / "home"
        self.home.mkdir()
        os.chown(self.home, UID, UID)
        self._rooms = folder / "rooms"

    def run(self, code: str, *words: str, **env: str) -> subprocess.CompletedProcess[str]:
        """Run the code to its end."""
        inner = ["setpriv", f"--reuid={UID}", f"--regid={UID}", "--clear-groups"]
        command = shlex.join([*inner, sys.executable, "-c", code, *words])
        script = "; ".join(["set -e", *self._openings(), f"exec {command}"])
        return subprocess.run(
            ["unshare", "--mount", "bash", "-c", script],  # noqa: S607
            env={
                "PATH": os.environ["PATH"],
                "HOME": str(self.home),
                "PYTHONPATH": str(ROOT),
                **env,
            },
            cwd="/",
            capture_output=True,
            text=True,
            timeout=200,
            check=False,
        )

    def _openings(self) -> Iterator[str]:
        """Commands by which what is needed below folders closed to others can be reached."""
        needed = {Path(sys.base_prefix), Path(sys.prefix), Path(sys.executable).parent, ROOT}
        closed: dict[Path, list[Path]] = {}
        for path in needed:
            for above in reversed(path.parents):
                if not above.stat().st_mode & 0o001:
                    closed.setdefault(above, []).append(path)
                    break
        for number, (above, paths) in enumerate(closed.items()):
            rooms = [self._rooms / f"{number}-{index}" for index in range(len(paths))]
            for path, room in zip(paths, rooms, strict=True):
                yield f"mkdir -p {room} && mount --bind {shlex.quote(str(path))} {room}"
            yield f"mount -t tmpfs -o mode=755 tmpfs {shlex.quote(str(above))}"
            for path, room in zip(paths, rooms, strict=True):
                there = shlex.quote(str(path))
                yield f"mkdir -p {there} && mount --bind {room} {there}"


@pytest.fixture
def second() -> Iterator[SecondUser]:
    """A second user with a home, below folders that everybody may enter."""
    folder = Path(tempfile.mkdtemp(dir="/tmp"))  # pytest's own is closed to others
    folder.chmod(0o755)
    yield SecondUser(folder)
    shutil.rmtree(folder)
    shutil.rmtree(f"/tmp/aerodaas-{UID}", ignore_errors=True)  # noqa: S108


@pytest.fixture
def streams() -> Iterator[Path]:
    """The first user, root, has streams in shared memory; their folder."""
    from aerodaas.actors.private_folder import private_folder  # noqa: PLC0415
    from aerodaas.actors.streams import Publisher, Subscriber  # noqa: PLC0415

    publisher = Publisher("of-the-first-user", "frames")
    subscriber = Subscriber("of-the-first-user", {"frames": 4})
    yield private_folder("streams")
    subscriber.close()
    publisher.close()


@needs(shared_memory_available(), "needs shared memory: `aerodaas doctor`")
def test_a_second_user_has_streams_too(second: SecondUser, streams: Path) -> None:
    """Whether or not root was first; in a folder that is closed to others, as root's is."""
    told = second.run(_STREAM)
    assert (told.returncode, told.stdout) == (0, "available\n"), told.stderr
    for user in (0, UID):
        found = Path(f"/tmp/aerodaas-{user}").lstat()  # noqa: S108
        assert (found.st_uid, found.st_mode & 0o777) == (user, 0o700)
    looked = second.run(f"import os; os.listdir({str(streams)!r})")
    assert "PermissionError" in looked.stderr


@needs(shared_memory_available(), "needs shared memory: `aerodaas doctor`")
@pytest.mark.parametrize("plant", ["folder", "link"])
def test_what_somebody_planted_is_not_used(second: SecondUser, plant: str) -> None:
    """Root's trap is seen, named with its remedy, and streams go another way."""
    path = Path(f"/tmp/aerodaas-{UID}")  # noqa: S108
    if plant == "folder":
        path.mkdir(0o777)
    else:
        path.symlink_to(second.home)
    try:
        told = second.run(_STREAM)
        assert told.returncode == 0, told.stderr
        assert f"{path} is a" in told.stdout
        assert f"sudo rm -r {path}" in told.stdout
        assert "pip install" not in told.stdout
        assert list(second.home.glob("aerodaas*")) == []
    finally:
        path.unlink() if plant == "link" else path.rmdir()


@pytest.mark.slow
@pytest.mark.usefixtures("runtime", "streams")
def test_a_second_user_runs_beside_the_first(second: SecondUser) -> None:
    """A Ray of their own, with a token of their own; and the first one's refuses them."""
    import ray  # noqa: PLC0415

    told = second.run(_RUN)
    assert told.returncode == 0, told.stderr
    assert told.stdout == f"{UID}\n0o600\n"
    address = "127.0.0.1:" + ray.get_runtime_context().gcs_address.rpartition(":")[2]
    refused = second.run(_JOIN, address)
    assert refused.returncode != 0
    assert f"the cluster at {address} refuses our token" in refused.stderr


@pytest.mark.usefixtures("runtime")
def test_without_any_token_the_first_ones_ray_refuses(second: SecondUser) -> None:
    """By Ray itself, not only by our own question before it."""
    import ray  # noqa: PLC0415

    code = (
        "import sys; from ray._raylet import GcsClient; "
        "GcsClient(address=sys.argv[1]).internal_kv_put(b'k', b'v', True, b'n', timeout=5)"
    )
    address = "127.0.0.1:" + ray.get_runtime_context().gcs_address.rpartition(":")[2]
    told = second.run(code, address, RAY_AUTH_MODE="disabled")
    assert told.returncode != 0
    assert "InvalidAuthToken" in told.stderr, told.stderr

"""A machine made of namespaces: its own network, processes and shared memory, one kernel.

The namespaces have no names: they live as long as the machine's first process, and that one lives
as long as its starter. So nothing is left behind, even when the starter is killed, and killing
one process, as `power_off` does, takes a machine away as a power cut would.
"""

from __future__ import annotations

import shlex
import stat
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path

import psutil

from aerodaas.errors import AeroDaaSError

__all__ = ["Machine", "run"]

# The shell is the machine's first process: it reaps those that lose their parents.
_INIT = "echo ready; while :; do sleep 3600 & wait; done"
_TIMEOUT = 300.0
_DYING_SECONDS = 5.0


def run(*words: str, env: Mapping[str, str] | None = None, timeout: float = _TIMEOUT) -> str:
    """Run a command to its end and return what it printed; raises AeroDaaSError if it fails."""
    try:
        done = subprocess.run(  # noqa: S603 - this project's own words
            words, capture_output=True, text=True, env=env, timeout=timeout, check=False
        )
    except FileNotFoundError:
        raise AeroDaaSError(
            f"{words[0]} is not installed; install util-linux and iproute2"
        ) from None
    except subprocess.TimeoutExpired:
        raise AeroDaaSError(f"`{shlex.join(words)}` took more than {timeout:.0f} s") from None
    if done.returncode != 0:
        said = (done.stderr.strip() or done.stdout.strip()).splitlines() or ["no reason given"]
        raise AeroDaaSError(f"`{shlex.join(words)}` failed: {' '.join(said[-3:])}")
    return done.stdout


class Machine:
    """One machine; with `network=False` it shares that of its starter.

    `scratch` are folders that it has to itself, empty at first. To be made by a thread that
    outlives it.
    """

    def __init__(self, name: str, *, network: bool = True, scratch: Sequence[Path] = ()) -> None:
        self.name = name
        kinds = ["--pid", "--mount", *(["--net"] if network else [])]
        self._enter = [*kinds, "--"]
        commands = [_mount(folder) for folder in scratch]
        commands += ["ip link set lo up"] if network else []
        script = "; ".join(["set -e", *commands, _INIT])
        words = ["setpriv", "--pdeathsig", "KILL", "unshare", *kinds, "--fork", "--kill-child"]
        self._starter = subprocess.Popen(  # noqa: S603 - this project's own words
            [*words, "--mount-proc", "bash", "-c", script],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._starter.stdout is not None  # noqa: S101 - asked for
        if self._starter.stdout.readline().strip() != "ready":
            _, said = self._starter.communicate()
            raise AeroDaaSError(f"cannot make the machine {name}: {said.strip()}")
        self._init = psutil.Process(self._starter.pid).children()[0]

    @property
    def pid(self) -> int:
        """Its first process, as seen from here."""
        return int(self._init.pid)

    @property
    def alive(self) -> bool:
        """False once it has lost its power."""
        return self._starter.poll() is None

    def words(self, *words: str) -> list[str]:
        """The command that runs `words` on this machine."""
        return ["nsenter", "--target", str(self.pid), *self._enter, *words]

    def run(self, *words: str, env: Mapping[str, str] | None = None) -> str:
        """Run a command there to its end; raises AeroDaaSError if it fails."""
        return run(*self.words(*words), env=env)

    def processes(self) -> list[psutil.Process]:
        """All that runs on it, as seen from here."""
        if not self.alive:
            return []
        home = Path(f"/proc/{self.pid}/ns/pid").readlink()
        return [one for one in psutil.process_iter() if _namespace(one.pid) == home]

    def find(self, pid: int) -> psutil.Process:
        """The process that has this number on the machine; raises AeroDaaSError without one."""
        for process in self.processes():
            status = Path(f"/proc/{process.pid}/status").read_text(encoding="utf-8")
            if f"NSpid:\t{process.pid}\t{pid}\n" in status:
                return process
        raise AeroDaaSError(f"no process of {self.name} has the number {pid}")

    def clear(self) -> None:
        """End everything on it but itself."""
        for process in self.processes():
            if process.pid != self.pid:
                process.kill()

    def power_off(self) -> None:
        """End everything on it at once."""
        left = self.processes()
        self._starter.kill()  # takes the machine's first process along, and that one all others
        self._starter.communicate()
        psutil.wait_procs(left, timeout=_DYING_SECONDS)


def _mount(folder: Path) -> str:
    """The command that hides what is in a folder, with the rights that it has."""
    rights = stat.S_IMODE(folder.stat().st_mode)
    return f"mount -t tmpfs -o mode={rights:o} tmpfs {shlex.quote(str(folder))}"


def _namespace(pid: int) -> Path | None:
    try:
        return Path(f"/proc/{pid}/ns/pid").readlink()
    except OSError:
        return None

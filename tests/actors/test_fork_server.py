"""Workers of a local Ray are forks of one process, or start Ray's own way."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from flying import Flyer, hop
from orphans import until, until_gone_with_its_parent

import aerodaas.actors.cluster.fork_server as module
from aerodaas import Environment
from aerodaas.actors.cluster import worker_launcher
from aerodaas.actors.cluster.ray_process import FORK_SERVER

SERVER, LAUNCHER = str(module.__file__), str(worker_launcher.__file__)
PROGRAM = """
import json, os, random, sys
import numpy as np
told = {"words": sys.argv[1:], "folder": os.getcwd(), "name": __name__, "first": sys.path[0]}
told |= {"mine": os.environ.get("MINE"), "job": os.environ["RAY_JOB_ID"]}
told |= {"drawn": [random.random(), np.random.random()], "id": os.getpid(), "parent": os.getppid()}
told["ready"] = "aerodaas.actors.run.flight" in sys.modules
told["group"] = os.getpgid(0) == os.getpid()
print(json.dumps(told), flush=True)
"""
ANEW = "import json; print(json.dumps({'ready': False, 'job': 'anew'}))"


class Pool:
    """A fork server, and a program in the place of Ray's for workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "worker.py").write_text(PROGRAM)
        (folder / "setup_worker.py").write_text(ANEW)
        self.socket = str(folder / "workers.sock")
        self.variables = {**os.environ, FORK_SERVER: self.socket, "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen([sys.executable, SERVER, self.socket], env=self.variables)
        until(Path(self.socket).exists)

    def start(self, *words: str, context: object = None, **variables: str) -> dict[str, Any]:
        """Start a worker as Ray does; what it tells of itself."""
        described = [f"--serialized-runtime-env-context={json.dumps(context or {})}"]
        command = [sys.executable, LAUNCHER, *words, str(self.folder / "worker.py"), "--of=mine"]
        done = subprocess.run(
            [*command, "--language=PYTHON", *described],
            env={**self.variables, "RAY_JOB_ID": "01", "MINE": "seen", **variables},
            cwd=self.folder,
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
        told: dict[str, Any] = json.loads(done.stdout)
        return told


@pytest.fixture(scope="module")
def pool(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pool]:
    """A fork server of its own, without Ray."""
    pool = Pool(tmp_path_factory.mktemp("pool"))
    yield pool
    pool.process.kill()
    pool.process.wait()


def test_a_fork_is_as_a_new_process(pool: Pool) -> None:
    """Its words, variables, folder and place for modules are its own; what it imports is there."""
    told = pool.start()
    assert told["ready"]
    assert told["words"] == ["--of=mine"]
    assert (told["mine"], told["job"]) == ("seen", "01")
    assert Path(told["folder"]) == Path(told["first"]) == pool.folder
    assert told["name"] == "__main__"
    assert told["group"], "Ray ends the group of a worker, which must not hold the others"
    assert pool.start(MINE="other")["mine"] == "other"


def test_no_two_draw_the_same(pool: Pool) -> None:
    """By Python's generator or numpy's."""
    one, other = pool.start(), pool.start()
    assert one["parent"] == other["parent"] != pool.process.pid
    assert not set(one["drawn"]) & set(other["drawn"])


def test_what_ray_reads_as_it_is_loaded_is_the_workers_own(pool: Pool) -> None:
    """Another job's workers come of another template."""
    one, other = pool.start(), pool.start(RAY_JOB_ID="02")
    assert (one["job"], other["job"]) == ("01", "02")
    assert one["parent"] != other["parent"]


@pytest.mark.parametrize(
    ("words", "context", "variables"),
    [
        ((), {"env_vars": {"A": "b"}}, {}),
        ((), {"py_executable": "/elsewhere/python"}, {}),
        ((), {"command_prefix": ["nice"]}, {}),
        (("-s",), {}, {}),
        ((), {}, {"PYTHONPATH": "/elsewhere"}),
        ((), {}, {"LD_LIBRARY_PATH": "/elsewhere"}),
        ((), {}, {FORK_SERVER: "/nowhere/workers.sock"}),
        ((), {}, {FORK_SERVER: ""}),
    ],
)
def test_what_a_fork_cannot_give_starts_anew(
    pool: Pool, words: tuple[str, ...], context: object, variables: dict[str, str]
) -> None:
    """Another interpreter, its flags, or what it reads at its start; a server that is not there."""
    assert pool.start(*words, context=context, **variables)["job"] == "anew"


def test_this_python_is_no_other(pool: Pool) -> None:
    """Ray names the interpreter that it would take."""
    context = {"py_executable": sys.executable, "env_vars": {}, "command_prefix": []}
    assert pool.start(context=context)["ready"]


def test_nonsense_ends_nothing(pool: Pool) -> None:
    """What is no question is left without an answer."""
    for nonsense in (b"", b"{", b"[]", b'{"words": 3}', b"\0" * 100_000):
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as caller:
            caller.connect(pool.socket)
            caller.send(nonsense)
    assert pool.start()["ready"]


def test_a_template_that_is_killed_is_made_again(pool: Pool) -> None:
    """Who asks first finds it dead, and starts Ray's own way."""
    before = pool.start()["parent"]
    dead = psutil.Process(before)
    dead.kill()
    until(lambda: not dead.is_running())
    assert not pool.start()["ready"]
    after = pool.start()
    assert after["ready"]
    assert after["parent"] != before


def test_they_end_with_who_started_them(tmp_path: Path) -> None:
    """Though it is killed."""
    path = tmp_path / "workers.sock"
    until_gone_with_its_parent([sys.executable, SERVER, str(path)], path.exists)


@pytest.mark.slow
def test_the_actors_of_a_flight_are_forks(flyer: Flyer) -> None:
    """Of this flight and of the next, whose workers Ray starts for no job in particular."""

    def fly(env: Environment) -> None:
        env.get_robot_by_id("drone").navigate(hop((30, 0)))

    for number in range(2):
        with flyer.flying(fly, record=flyer.folder / str(number)) as env:
            run = env.launch()
            assert run._flight is not None
            infos = run._flight.infos().values()
            parents = {psutil.Process(info.pid).parent() for info in infos}
            (template,) = parents
            assert template is not None
            assert SERVER in template.cmdline()

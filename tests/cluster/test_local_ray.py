"""A local Ray that does not start says why."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from aerodaas.actors.cluster import local_ray
from aerodaas.actors.cluster.head_watch import answers
from aerodaas.actors.cluster.local_ray import LocalRay
from aerodaas.errors import AeroDaaSError


@pytest.mark.slow
def test_what_ray_said_last_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here its Python finds no library of its own."""
    monkeypatch.setenv("PYTHONHOME", "/nowhere")
    ray = LocalRay()
    with pytest.raises(AeroDaaSError, match=r"does not start on this machine:(?s:.*)encodings"):
        _ = ray.address


def test_it_starts_without_the_packages_of_rays_client(tmp_path: Path) -> None:
    """As `pip install aerodaas` leaves it: gRPC comes with extras of Ray only."""
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['grpc'] = None\n")
    code = (
        "from aerodaas.actors.cluster.local_ray import LocalRay\n"
        "ray = LocalRay()\nprint(ray.address)\nray.end()"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        check=False,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("127.0.0.1:")


def test_what_stopped_the_supervisor_is_told() -> None:
    """Its output is nobody's; the application tells it."""
    code = "from aerodaas.actors.cluster import ray_process as one\none.main(%d, '', ['\\0'])"
    ended = subprocess.run(
        [sys.executable, "-c", code % os.getpid()],
        stdin=subprocess.PIPE,
        capture_output=True,
        check=False,
        text=True,
    )
    assert ended.returncode == 1
    assert json.loads(ended.stdout) == {"error": "ValueError: embedded null byte"}


def test_a_start_that_takes_too_long_is_no_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """The remedy is another one."""
    monkeypatch.setattr(local_ray, "_START_SECONDS", 0.01)
    ray = LocalRay()
    with pytest.raises(AeroDaaSError, match="this machine is too busy"):
        _ = ray.address


@pytest.mark.parametrize("reply", [None, b"\0", b""], ids=["hangs", "speaks", "hangs up"])
def test_only_a_process_that_runs_answers(reply: bytes | None) -> None:
    """The kernel accepts connections of one that hangs; a server that expects TLS hangs up."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = server.getsockname()

        def serve() -> None:
            link, _ = server.accept()
            with link:
                link.sendall(reply or b"")

        if reply is not None:
            threading.Thread(target=serve, daemon=True).start()
        assert answers(address) == (reply is not None)
    assert not answers(address)

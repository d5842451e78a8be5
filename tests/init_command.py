"""`aerodaas init` in an empty folder, and senders of packets that its search can hear."""

from __future__ import annotations

import io
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from command_line import ran

from aerodaas.config.model import EnvironmentConfig
from aerodaas.runtime.checks import check_environment

LOOPBACK = "127.0.0.1"
Command = Callable[..., tuple[int, str]]


@pytest.fixture
def init_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Command:
    """The command in an empty folder, with answers to its questions: exit code and all it says."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str, answers: str = "", command: str = "init") -> tuple[int, str]:
        monkeypatch.setattr("sys.stdin", io.StringIO(answers))
        code, out, said = ran(capsys, command, *words)
        return code, out + said

    return run


def load(path: str = "environment.json") -> EnvironmentConfig:
    """The file, checked as an application's is."""
    config = EnvironmentConfig.load(path)
    check_environment(config, path)
    return config


@contextmanager
def beating(*messages: object, port: int) -> Iterator[socket.socket]:
    """A sender of these packets to a port of loopback, ten times a second."""
    over = threading.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind((LOOPBACK, 0))
        sender.settimeout(0.0)

        def send() -> None:
            while not over.wait(0.1):
                for message in messages:
                    sender.sendto(message if isinstance(message, bytes) else b"", (LOOPBACK, port))

        thread = threading.Thread(target=send)
        thread.start()
        try:
            yield sender
        finally:
            over.set()
            thread.join()


def free_udp() -> int:
    """A port that nobody uses at present."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port

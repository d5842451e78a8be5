"""Signals that a shell has a process ignore: a drone lands all the same, and nohup is obeyed."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import os, signal, time
signal.signal(signal.SIGINT, signal.SIG_IGN)
signal.signal(signal.SIGHUP, signal.SIG_IGN)
from aerodaas.environment.signals import {function}
{function}()
os.kill(os.getpid(), signal.SIGHUP)
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(1)
    print("ignored")
except KeyboardInterrupt:
    print("interrupted")
"""


def _told(function: str) -> str:
    command = [sys.executable, "-c", CODE.format(function=function)]
    ended = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    return ended.stdout.strip()


def test_a_run_in_the_background_of_a_script_is_interrupted() -> None:
    """Before Ray has started and after; a closed terminal ends it only where nohup permits."""
    assert _told("heed_interrupts") == "interrupted"
    assert _told("raise_on_signals") == "interrupted"

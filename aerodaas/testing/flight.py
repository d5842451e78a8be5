"""A flight of an application's file, for its author's tests."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from aerodaas.errors import MissionError
from aerodaas.recording.reader import Recording
from aerodaas.recording.report.flight import RecordedFlight

__all__ = ["fly"]


def fly(
    application: Path,
    folder: Path,
    *words: str,
    seed: int = 0,
    settings: Mapping[str, object] | None = None,
    speed: str = "max",
    timeout: float = 600.0,
) -> RecordedFlight:
    """Fly an application as `aerodaas run` does, and read its recording.

    Args:
        application: Python file, or mission document.
        folder: Where the recording and the report go (`tmp_path` of pytest); new, or empty.
        words: Arguments of the application.
        seed: Of the simulation; the same one gives the same flight.
        settings: Laid over the environment file, by `id.setting`, as by `--set`.
        speed: Mission seconds per wall second, or as fast as the machine goes, which needs
            vehicles that are simulated: `"1"` for others.
        timeout: Wall seconds that the flight may take.

    Returns:
        States, waypoints, alerts and streams of the flight.

    Raises:
        MissionError: If it ends with an error, whose text it holds, or takes too long.
    """
    command = [sys.executable, "-m", "aerodaas", "run", str(application), "--no-view"]
    command += ["--speed", speed, "--seed", str(seed), "--record", str(folder)]
    for name, value in (settings or {}).items():
        command += ["--set", f"{name}={value if isinstance(value, str) else json.dumps(value)}"]
    ended, told = _run([*command, "--", *words], timeout)
    if ended is None:
        raise MissionError(f"{application} still flew after {timeout:.0f} s: give more timeout")
    if ended:
        raise MissionError(f"{application} ended with code {ended}:\n{told}")
    with Recording.open(folder / "flight.mcap") as recording:
        return RecordedFlight.read(recording)


def _run(command: list[str], timeout: float) -> tuple[int | None, str]:
    """Exit code, None if it had to be interrupted, and what it printed."""
    with subprocess.Popen(  # noqa: S603 - our own command
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        try:
            told, _ = process.communicate(timeout=timeout)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)  # the drone lands, the recording is closed
            return None, process.communicate()[0]
    return process.returncode, told

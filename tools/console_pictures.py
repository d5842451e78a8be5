"""Take the documentation's pictures of the console, from flights that are flown for them.

`python -m tools.console_pictures` writes them to `docs/images`. It flies `vehicle_tracking` in
simulation, once in real time to look on and once for the recording, and opens the console of each
in the browser that is installed.
"""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import typer

from tools.browser import Browser, Page

_ROOT = Path(__file__).resolve().parents[1]
_IMAGES = _ROOT / "docs" / "images"
_APPLICATION = "apps/vehicle_tracking.py"
_WAIT_SECONDS = 180.0
_FOUND = "document.querySelector('[data-testid=video]')?.dataset.boxes > 0"
_LATE = "Number(document.querySelectorAll('.state .figure dd')[5].innerText.split(' ')[0]) > 45"
"""The drone has left the first waypoint, and follows."""
_SETTLED = 1.0


def main() -> None:
    """Fly, look on, and write the pictures."""
    _IMAGES.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        words = ("run", _APPLICATION, "--no-view", "--record")
        console = ("--console", "--console-address", "127.0.0.1:0")
        with _told(*words, str(folder / "live"), *console) as address, Browser() as browser:
            page = browser.open(address, 1360, 900)
            page.until(f"{_FOUND} && {_LATE}", _WAIT_SECONDS)
            _take(page, "console-live.webp")
        command = [sys.executable, "-m", "aerodaas", *words, str(folder / "flight")]
        subprocess.run(command, cwd=_ROOT, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - ours
        recording = str(folder / "flight" / "flight.mcap")
        watching = ("view", recording, "--at", "95", "--address", "127.0.0.1:0")
        with _told(*watching) as address, Browser() as browser:
            for name, width, height, scheme in (
                ("console-playback.webp", 1360, 900, "light"),
                ("console-phone.webp", 400, 860, "dark"),
            ):
                page = browser.open(address, width, height)
                page.resize(width, height, scheme)
                page.until(_FOUND, _WAIT_SECONDS)
                _take(page, name)


@contextmanager
def _told(*words: str) -> Iterator[str]:
    """Run `aerodaas`; the address of the console that it tells first."""
    with tempfile.TemporaryFile("w+") as log:
        process = subprocess.Popen(  # noqa: S603 - ours
            [sys.executable, "-m", "aerodaas", *words], cwd=_ROOT, stdout=log, stderr=log
        )
        try:
            yield _address(process, log)
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(_WAIT_SECONDS)


def _address(process: subprocess.Popen[bytes], log: IO[str]) -> str:
    until = time.monotonic() + _WAIT_SECONDS
    while True:
        log.seek(0)
        said = log.read()
        if found := re.search(r"http://\S+#token=\S+", said):
            return found[0]
        if process.poll() is not None or time.monotonic() > until:
            raise SystemExit(said or "it does not tell where its console is")
        time.sleep(0.2)


def _take(page: Page, name: str) -> None:
    time.sleep(_SETTLED)
    page.picture(_IMAGES / name)
    size = (_IMAGES / name).stat().st_size
    sys.stdout.write(f"{_IMAGES / name}: {size / 1e3:.0f} kB\n")


if __name__ == "__main__":
    typer.run(main)

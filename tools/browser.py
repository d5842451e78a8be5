"""A real browser, driven by the DevTools protocol: pages are opened, clicked and looked at."""

from __future__ import annotations

import base64
import itertools
import json
import os
import shutil
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from typing_extensions import Self
from websockets.sync.client import ClientConnection, connect

__all__ = ["BROWSERS", "Browser", "BrowserError", "Page"]

BROWSERS = ("chromium", "chromium-browser", "google-chrome")
"""The first of these that is installed is taken, unless AERODAAS_BROWSER names another one."""

_WORDS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--remote-debugging-port=0",
)  # fmt: skip
_START_SECONDS = 60.0
_WAIT_SECONDS = 60.0
_MOST = 64 << 20
_QUALITY = 82
"""Of a WebP, 0 to 100: text stays sharp, and a camera's picture takes few bytes."""


class BrowserError(AssertionError):
    """The browser, or the page in it, does not do what it should."""


class Browser:
    """A browser with a profile of its own, which ends with it."""

    def __enter__(self) -> Self:
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        folder = Path(self._profile.name)
        command = [_program(), *_WORDS, f"--user-data-dir={folder}", "about:blank"]
        self._process = subprocess.Popen(command, stderr=subprocess.DEVNULL)  # noqa: S603 - see _program
        self.pid = self._process.pid
        port, until = folder / "DevToolsActivePort", time.monotonic() + _START_SECONDS
        while not port.is_file() or not port.read_text().partition("\n")[2]:
            if time.monotonic() > until:
                raise BrowserError("the browser does not start")
            time.sleep(0.05)
        number, path = port.read_text().split()
        self._stack = ExitStack()
        url = f"ws://127.0.0.1:{number}{path}"
        self._wire = _Wire(self._stack.enter_context(connect(url, max_size=_MOST, max_queue=None)))
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        self._process.terminate()
        self._process.wait(20)
        self._profile.cleanup()

    def open(self, url: str, width: int = 1280, height: int = 900) -> Page:
        """A tab of its own, without what other tabs have stored."""
        context = self._wire.ask("Target.createBrowserContext")["browserContextId"]
        target = self._wire.ask("Target.createTarget", url="about:blank", browserContextId=context)
        words = {"targetId": target["targetId"], "flatten": True}
        session = self._wire.ask("Target.attachToTarget", **words)["sessionId"]
        return Page(self._wire, session, url, width, height)


def _program() -> str:
    named = os.environ.get("AERODAAS_BROWSER", "")
    program = named or next(filter(None, map(shutil.which, BROWSERS)), "")
    if not program:
        raise BrowserError(f"install one of {', '.join(BROWSERS)}, or name it in AERODAAS_BROWSER")
    return program


class Page:
    """One tab."""

    def __init__(self, wire: _Wire, session: str, url: str, width: int, height: int) -> None:
        self._wire = wire
        self._session = session
        self._complaints: list[str] = []
        for domain in ("Page", "Runtime", "Log"):
            self._ask(f"{domain}.enable")
        self.resize(width, height)
        self.go(url)

    def before(self, script: str) -> None:
        """Run a script in each document that is opened from now on, before its own."""
        self._ask("Page.addScriptToEvaluateOnNewDocument", source=script)

    def go(self, url: str) -> None:
        """Open another address."""
        self._ask("Page.navigate", url=url)

    def resize(self, width: int, height: int, scheme: str = "light") -> None:
        """Show it in a window of this size, in a light or dark scheme."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", **size)
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        self._ask("Emulation.setEmulatedMedia", features=features)

    def run(self, script: str) -> Any:  # noqa: ANN401 - JSON
        """The value of an expression, awaited."""
        words = {"expression": script, "awaitPromise": True, "returnByValue": True}
        answer = self._ask("Runtime.evaluate", **words)
        if "exceptionDetails" in answer:
            raise BrowserError(json.dumps(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def until(self, script: str, seconds: float = _WAIT_SECONDS) -> None:
        """Wait until an expression is true, as JavaScript has it."""
        until = time.monotonic() + seconds
        while not self.run(f"Boolean({script})"):
            if time.monotonic() > until:
                shown = self.run("document.body?.innerText.slice(0, 2000)")
                raise BrowserError(f"not so: {script}\n{shown}\n{self.complaints()}")
            time.sleep(0.05)

    def text(self, selector: str) -> str:
        """The text of an element; empty where there is none."""
        return str(self.run(f"document.querySelector({json.dumps(selector)})?.innerText ?? ''"))

    def click(self, x: float, y: float) -> None:
        """Press and release the mouse at a point of the window."""
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self._mouse(kind, x, y)

    def press(self, selector: str) -> None:
        """Click the middle of an element, which comes into view first."""
        place = json.dumps(selector)
        self.run(f"document.querySelector({place}).scrollIntoView({{block: 'center'}})")
        at = self.run(
            f"(b => [b.x + b.width / 2, b.y + b.height / 2])"
            f"(document.querySelector({place}).getBoundingClientRect())"
        )
        self.click(*at)

    def key(self, key: str) -> None:
        """Press a key on what has the focus."""
        for kind in ("keyDown", "keyUp"):
            self._ask(
                "Input.dispatchKeyEvent", type=kind, key=key, text=key if len(key) == 1 else ""
            )

    def drag(self, x: float, y: float, to_x: float, to_y: float) -> None:
        """Press the mouse at a point of the window, move it in steps, and release it."""
        self._mouse("mousePressed", x, y)
        for step in (0.3, 0.6, 1.0):
            self._mouse("mouseMoved", x + step * (to_x - x), y + step * (to_y - y))
        self._mouse("mouseReleased", to_x, to_y)

    def hold(self, code: str, key: str) -> None:
        """Press a key by its place on the keyboard, and keep it down."""
        self._ask("Input.dispatchKeyEvent", type="keyDown", code=code, key=key)

    def front(self) -> None:
        """Bring the tab to the front."""
        self._ask("Page.bringToFront")

    def kill(self) -> None:
        """End the tab's process, as a crash would; it answers nothing any more."""
        self._wire.send("Page.crash", self._session)

    def picture(self, path: Path) -> None:
        """Write what the window shows, as a PNG or a WebP by the file's name."""
        words: dict[str, Any] = {"format": "png"}
        if path.suffix == ".webp":
            words = {"format": "webp", "quality": _QUALITY}
        path.write_bytes(base64.b64decode(self._ask("Page.captureScreenshot", **words)["data"]))

    def complaints(self) -> list[str]:
        """Errors that the browser has told since the page was opened."""
        self.run("0")
        for event in self._wire.take_events(self._session):
            said = event["params"]
            if event["method"] == "Runtime.exceptionThrown":
                self._complaints.append(json.dumps(said["exceptionDetails"]))
            if event["method"] == "Log.entryAdded" and said["entry"]["level"] == "error":
                self._complaints.append(said["entry"]["text"])
        return self._complaints

    def _mouse(self, kind: str, x: float, y: float) -> None:
        words = {"type": kind, "x": x, "y": y, "button": "left", "clickCount": 1}
        self._ask("Input.dispatchMouseEvent", **words)

    def _ask(self, method: str, **words: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
        return self._wire.ask(method, self._session, **words)


class _Wire:
    """Requests and answers by number; events are kept for their session."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._numbers = itertools.count(1)
        self._events: list[dict[str, Any]] = []

    def send(self, method: str, session: str = "", **words: Any) -> int:  # noqa: ANN401 - JSON
        number = next(self._numbers)
        question: dict[str, Any] = {"id": number, "method": method, "params": words}
        if session:
            question["sessionId"] = session
        self._socket.send(json.dumps(question))
        return number

    def ask(self, method: str, session: str = "", **words: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
        number = self.send(method, session, **words)
        while True:
            answer: dict[str, Any] = json.loads(self._socket.recv(_WAIT_SECONDS))
            if answer.get("id") == number:
                if "error" in answer:
                    raise BrowserError(f"{method}: {answer['error']}")
                found: dict[str, Any] = answer["result"]
                return found
            if answer.get("method") in {"Runtime.exceptionThrown", "Log.entryAdded"}:
                self._events.append(answer)

    def take_events(self, session: str) -> list[dict[str, Any]]:
        mine = [one for one in self._events if one.get("sessionId") == session]
        self._events = [one for one in self._events if one.get("sessionId") != session]
        return mine

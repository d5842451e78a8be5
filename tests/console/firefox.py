"""A Firefox, driven by WebDriver BiDi, which it speaks itself."""

from __future__ import annotations

import itertools
import json
import re
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from required import peer
from typing_extensions import Self
from websockets.sync.client import connect

__all__ = ["Firefox"]

_WORDS = ("--headless", "--no-remote", "--remote-debugging-port", "0", "--profile")
_SECONDS = 60.0


class Firefox:
    """A Firefox of one tab, with a profile of its own."""

    def __enter__(self) -> Self:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        log = Path(self._folder.name) / "log"
        command = [peer("AERODAAS_FIREFOX"), *_WORDS, self._folder.name]
        with log.open("w") as file:
            self._process = subprocess.Popen(command, stdout=file, stderr=file)
        until = time.monotonic() + _SECONDS
        while not (told := re.search(r"BiDi listening on (ws://\S+)", log.read_text())):
            assert time.monotonic() < until, log.read_text()
            time.sleep(0.1)
        self._numbers = itertools.count(1)
        self._stack = ExitStack()
        self._socket = self._stack.enter_context(connect(f"{told[1]}/session", max_size=None))
        self._ask("session.new", capabilities={})
        self._tab = self._ask("browsingContext.getTree")["contexts"][0]["context"]
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()
        self._process.terminate()
        self._process.wait(20)
        self._folder.cleanup()

    def go(self, url: str) -> None:
        """Open an address."""
        self._ask("browsingContext.navigate", context=self._tab, url=url, wait="complete")

    def run(self, script: str) -> Any:  # noqa: ANN401 - JSON
        """The value of an expression, awaited."""
        words = {"target": {"context": self._tab}, "awaitPromise": True}
        whole = f"(async () => JSON.stringify((await ({script})) ?? null))()"
        answer = self._ask("script.evaluate", expression=whole, **words)
        assert answer["type"] == "success", answer
        return json.loads(answer["result"]["value"])

    def until(self, script: str) -> None:
        """Wait until an expression is true."""
        until = time.monotonic() + _SECONDS
        while not self.run(f"Boolean({script})"):
            assert time.monotonic() < until, script
            time.sleep(0.05)

    def _ask(self, method: str, **words: Any) -> dict[str, Any]:  # noqa: ANN401 - JSON
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": words}))
        while True:
            answer = json.loads(self._socket.recv(_SECONDS))
            if answer.get("id") == number:
                assert answer["type"] == "success", answer
                found: dict[str, Any] = answer["result"]
                return found

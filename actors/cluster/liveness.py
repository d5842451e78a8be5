"""Liveness monitor: reports actors that die or restart as soon as Ray detects it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from typing import Any, Literal

from ray.exceptions import ActorUnavailableError, RayError

__all__ = ["ASKED_AGAIN", "LIFE", "LIFELINES", "Life", "LivenessMonitor"]

LIFE = "life"
"""Concurrency group of an actor for the waiting calls of its liveness monitors."""
LIFELINES = 2
"""Most liveness monitors of one actor: its run's and, for an executor, the dispatcher's."""
Life = Literal["serving", "restarting", "gone"]
ASKED_AGAIN = 0.1
"""Seconds before an unavailable actor is called again; Ray's own retries take a second."""


class LivenessMonitor:
    """Liveness monitor with one pending call in each actor, whose end reports a change."""

    def __init__(self, actors: Mapping[str, Any], tell: Callable[[str, Life], None]) -> None:
        """Monitor Ray actor handles by name; `tell` receives name and change, in any thread.

        An actor has the methods `await_start` and `await_stop` and the concurrency group LIFE.
        """
        self._tell = tell
        self._names: dict[Any, list[str]] = {}
        """Names of each actor; Ray's handles of one actor are equal."""
        self._ended = False
        for name, actor in actors.items():
            self._names.setdefault(actor, []).append(name)
        for actor in self._names:
            self._ask(actor, "await_start")

    def end(self) -> None:
        """Stop monitoring."""
        self._ended = True

    def _ask(self, actor: Any, what: Literal["await_start", "await_stop"]) -> None:  # noqa: ANN401
        method = getattr(actor, what)
        reference = method.options(concurrency_group=LIFE).remote()

        def heard(future: Future[None]) -> None:
            if self._ended:
                return
            error = future.exception()
            if error is None and what == "await_start":
                self._news(actor, "serving")
                self._ask(actor, "await_stop")
            elif isinstance(error, ActorUnavailableError):
                self._news(actor, "restarting")
                timer = threading.Timer(ASKED_AGAIN, self._ask, (actor, "await_start"))
                timer.daemon = True
                timer.start()
            elif isinstance(error, RayError):
                self._news(actor, "gone")

        reference.future().add_done_callback(heard)

    def _news(self, actor: Any, life: Life) -> None:  # noqa: ANN401
        for name in self._names[actor]:
            self._tell(name, life)

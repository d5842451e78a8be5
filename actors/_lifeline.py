"""Word of executors that die and come back, from Ray itself, as soon as it knows."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future
from typing import Any, Literal

from ray.exceptions import ActorUnavailableError, RayError

__all__ = ["LIFE", "Life", "Lifelines"]

LIFE = "life"
"""Concurrency group of an executor's actor in which the calls of its lifeline wait."""
Life = Literal["serving", "restarting", "gone"]
_AGAIN = 0.5
"""Seconds before Ray is asked again where it does not know."""


class Lifelines:
    """One call waits in each executor's actor for as long as it lives; its end is the news."""

    def __init__(self, executors: Mapping[str, Any], wake: Callable[[], None]) -> None:
        """Watch over Ray actor handles by model; `wake` is called, from any thread, with news.

        An actor has the methods `await_start` and `await_stop` and the concurrency group LIFE.
        """
        self._wake = wake
        self._news: deque[tuple[str, Life]] = deque()
        self._models: dict[Any, list[str]] = {}
        self._handles: dict[Any, Any] = {}
        self._ended = False
        for model, handle in executors.items():
            actor = handle._actor_id  # noqa: SLF001 - Ray has no other name for it
            self._models.setdefault(actor, []).append(model)
            self._handles[actor] = handle
        for actor in self._handles:
            self._ask(actor, "await_start")

    def news(self) -> Iterator[tuple[str, Life]]:
        """Yield what has happened since the last call, by model."""
        while self._news:
            yield self._news.popleft()

    def end(self) -> None:
        """Watch no longer."""
        self._ended = True

    def _ask(self, actor: Any, what: Literal["await_start", "await_stop"]) -> None:  # noqa: ANN401
        method = getattr(self._handles[actor], what)
        reference = method.options(concurrency_group=LIFE).remote()

        def heard(future: Future[None]) -> None:
            if self._ended:
                return
            error = future.exception()
            if error is None and what == "await_start":
                self._tell(actor, "serving")
                self._ask(actor, "await_stop")
            elif isinstance(error, ActorUnavailableError):
                self._tell(actor, "restarting")
                timer = threading.Timer(_AGAIN, self._ask, (actor, "await_start"))
                timer.daemon = True
                timer.start()
            elif isinstance(error, RayError):
                self._tell(actor, "gone")

        reference.future().add_done_callback(heard)

    def _tell(self, actor: Any, life: Life) -> None:  # noqa: ANN401
        self._news.extend((model, life) for model in self._models[actor])
        self._wake()

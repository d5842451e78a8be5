"""Stand-in for the user's side in a rehearsal: answers each question with no result."""

from __future__ import annotations

import queue
import threading
from typing import Any

from aerodaas.analytics.here.relay import HereRelay

__all__ = ["attach_absent_user"]


def attach_absent_user(relay: HereRelay) -> None:
    """Answer the relay's questions with no result: code at the user's side is not rehearsed."""
    questions: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    user = relay.attach(lambda question, _: questions.put(question))

    def answer() -> None:
        while True:
            number = questions.get()["number"]
            user.answered({"number": number, "item": None, "fired": [], "alerts": []})

    threading.Thread(target=answer, name="absent user", daemon=True).start()

"""GuestAnalysis: stands for an analysis of a guest in the owner's graph, and calls it.

It is the work of a node, in real time in an actor of this guest alone. Its `process` asks the
guest's process, which holds the guest's code. All analyses of a guest share that process and take
turns in it.
"""

from __future__ import annotations

import pickle
import threading
from typing import Any

from aerodaas.analytics.base import Analytics, Context
from aerodaas.analytics.guests.answers import AnswerReader
from aerodaas.analytics.guests.channel import GuestError
from aerodaas.analytics.guests.payload import require_no_moves
from aerodaas.analytics.guests.process import GuestProcess
from aerodaas.config.grants import GuestQuota
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ModelError
from aerodaas.messages.records import without_secrets

__all__ = ["GuestAnalysis"]

_OPENING = 40.0
"""Wall seconds for a guest to open its analyses: models are large."""
_ITEM = 4.0
"""Wall seconds for a guest to process one item; shorter than the alert of a hung analysis."""
_processes: dict[str, GuestProcess] = {}
"""Running guests of this process."""
_lock = threading.Lock()


class GuestAnalysis(Analytics[Any]):
    """One analysis of a guest."""

    def __init__(
        self,
        guest: str,
        key: str,
        quota: GuestQuota,
        *,
        navigates: bool,
        sees_vehicle: bool,
        program: bytes = b"",
    ) -> None:
        """Call the analysis `key` of `guest`.

        Args:
            guest: Name of the guest.
            key: Id of the analysis in the guest's own graph.
            quota: Most of each thing that the guest may use.
            navigates: Whether its results are navigation.
            sees_vehicle: Whether it may ask for the vehicle's state.
            program: The guest's code and objects, which only its process may decode; with the
                first analysis of each guest.
        """
        self.guest = guest
        self.key = key
        self.quota = quota
        self.sees_vehicle = sees_vehicle
        self.program = program
        self._failed = ""
        produces = AeroNavigation if navigates else object
        self._answers = AnswerReader(guest, key, produces, kind="guest", title=f"guest {guest}")

    def open(self) -> None:
        """Start the guest's process with its first analysis; one that fails stays silent."""
        if not self.program:
            return
        # Told with the first item: a guest that fails here must not keep its owner from flying.
        try:
            process = GuestProcess(self.guest, self.quota.memory)
            with _lock:
                _processes[self.guest] = process
            process.ask({"do": "open"}, self.program, _OPENING)
        except GuestError as error:
            self._failed = str(error)

    def process(self, item: Any, context: Context) -> Any:  # noqa: ANN401 - any result
        """Ask the guest's process; None, and an error once, if it has ended."""
        self._answers.forget()
        process = _processes.get(self.guest)
        if process is None:
            failed, self._failed = self._failed, ""
            if failed:
                raise ModelError(f"the guest {self.guest} did not start: {failed}")
            return None
        try:
            state = context.vehicle() if self.sees_vehicle else None
            vehicle = None if state is None else without_secrets(state)
            blob = pickle.dumps((item, vehicle), protocol=5)
            request = {"do": "process", "key": self.key, "now": context.now(), "on": context.kind}
            answer, _ = process.ask(request, blob, _ITEM)
            return require_no_moves(self._answers.read(answer, context), self.guest)
        except GuestError as error:
            if process.told:
                return None
            process.told = True
            raise ModelError(f"the guest {self.guest} has been ended: {error}") from None

    def close(self) -> None:
        """End the guest's process."""
        with _lock:
            process = _processes.pop(self.guest, None) if self.program else None
        if process is not None:
            process.end()

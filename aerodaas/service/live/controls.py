"""Controls of a drone by hand over a WebSocket: velocities in, and a dead man's switch.

Whoever falls silent loses the controls in steps. The drone obeys each velocity for
`MANUAL_SECONDS` and then brakes, whatever becomes of the page, the network and this server; a
connection that ends lets go at once, and one that says nothing for `_SILENT_SECONDS` is ended.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import time
from collections.abc import Callable
from typing import TypeAlias

from fastapi import WebSocket, WebSocketDisconnect
from pydantic import ValidationError

from aerodaas.errors import AeroDaaSError
from aerodaas.mission.commands import Answer, ReleaseControls, Steer, TakeControls
from aerodaas.protocol.piloting import ControlsOut, SteerIn
from aerodaas.service.http.gate import SUBPROTOCOL
from aerodaas.service.live.session import end_jobs

__all__ = ["ControlCommand", "ControlSession", "Freshness"]

ControlCommand: TypeAlias = TakeControls | Steer | ReleaseControls
_SILENT_SECONDS = 1.0
"""Wall seconds without a velocity after which the controls are let go."""
_LONGEST = 1000
"""Characters of a velocity."""
_LEAST_PERIOD = 0.03
"""Wall seconds between two commands to the drone; of what comes meanwhile the newest counts."""
_RENEWAL_SECONDS = 1.0
"""Wall seconds between two looks at whether the sender still may fly."""
_STALE_SECONDS = 0.2
"""Wall seconds by which a velocity may be later than the quickest one before it."""


class Freshness:
    """Tells what was under way for too long, by the clocks of sender and receiver alone.

    Their difference is the least that was seen, which belongs to the quickest message.
    """

    def __init__(self) -> None:
        self._least = float("inf")

    def is_fresh(self, sent: float, received: float) -> bool:
        """Whether a message is obeyed.

        Args:
            sent: When it was sent, in seconds of the sender's clock.
            received: When it was received, in seconds of our clock.
        """
        self._least = min(self._least, received - sent)
        return received - sent - self._least <= _STALE_SECONDS


class ControlSession:
    """One operator's hand on one drone."""

    def __init__(
        self,
        socket: WebSocket,
        operator: str,
        give: Callable[[ControlCommand], Answer],
        renew: Callable[[], None] = lambda: None,
    ) -> None:
        """Steer by `socket`, which is not accepted yet.

        Args:
            socket: Of the operator.
            operator: Name for the others to read.
            give: Gives the drone a command, in another thread; raises AeroDaaSError.
            renew: Raises AeroDaaSError once the operator may not fly any more.
        """
        self._socket = socket
        self._operator = operator
        self._give = give
        self._renew = renew
        self._session = secrets.randbits(62) + 1
        self._fresh = Freshness()
        self._newest: SteerIn | None = None
        self._arrived = 0.0
        self._came = asyncio.Event()

    async def run(self) -> Answer:
        """Take the controls, and steer until they are let go; returns what the drone said first."""
        offered = self._socket.scope.get("subprotocols", ())
        await self._socket.accept(SUBPROTOCOL if SUBPROTOCOL in offered else None)
        taken = await self._told(TakeControls(self._operator, self._session))
        reading = asyncio.create_task(self._read())
        steering = asyncio.create_task(self._steer())
        try:
            if await self._answer(0.0, taken):
                await asyncio.wait((reading, steering), return_when=asyncio.FIRST_COMPLETED)
        finally:
            await end_jobs(f"control by hand of {self._operator}", [steering], [reading])
            if taken.accepted:
                await self._told(ReleaseControls(self._session))
            with contextlib.suppress(WebSocketDisconnect, RuntimeError):
                await self._socket.close()
        return taken

    async def _steer(self) -> None:
        """Pass on the newest velocity, until nothing comes or the drone does not obey."""
        renewed = time.monotonic()
        while True:
            try:
                await asyncio.wait_for(self._came.wait(), _SILENT_SECONDS)
            except asyncio.TimeoutError:
                text = f"nothing was heard of this page for {_SILENT_SECONDS:g} s"
                await self._answer(0.0, Answer(accepted=False, text=text))
                return
            self._came.clear()
            wanted = self._newest
            assert wanted is not None  # noqa: S101 - came
            if time.monotonic() - self._arrived > _STALE_SECONDS:
                # The drone's answer to the one before took too long.
                continue
            renews = time.monotonic() - renewed > _RENEWAL_SECONDS
            renewed = time.monotonic() if renews else renewed
            said = await self._told(Steer(self._session, wanted.velocity()), renews=renews)
            if not await self._answer(wanted.at, said):
                return
            await asyncio.sleep(_LEAST_PERIOD)

    async def _read(self) -> None:
        """Keep the newest velocity; return when the operator has gone or talks nonsense."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError):
            while True:
                text = await self._socket.receive_text()
                try:
                    # Whatever the connection takes, more than this is read for nobody.
                    wanted = SteerIn.model_validate_json(text[:_LONGEST])
                except ValidationError as error:
                    first = error.errors(include_input=False)[0]
                    place = ".".join(map(str, first["loc"]))
                    said = f"{place}: {first['msg']}" if place else first["msg"]
                    await self._answer(0.0, Answer(accepted=False, text=said))
                    return
                arrived = time.monotonic()
                if self._fresh.is_fresh(wanted.at / 1000, arrived):
                    self._newest, self._arrived = wanted, arrived
                    self._came.set()

    async def _told(self, command: ControlCommand, *, renews: bool = False) -> Answer:
        """Give a command, and take a failure for a refusal."""

        def give() -> Answer:
            if renews:
                self._renew()
            return self._give(command)

        try:
            return await asyncio.to_thread(give)
        except AeroDaaSError as error:
            return Answer(accepted=False, text=str(error))

    async def _answer(self, at: float, said: Answer) -> bool:
        """Tell the operator what the drone said; returns whether they have the controls."""
        answer = ControlsOut(held=said.accepted, at=at, text=said.text)
        await self._socket.send_text(answer.model_dump_json())
        return said.accepted

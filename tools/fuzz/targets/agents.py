"""Calls of the agents' tools, in process: wrong, huge, stale, foreign, cancelled, 16 at once.

An input is JSON: a list of steps. A step is a list of calls that are made together, or `approved`,
by which an operator approves what waits for it. The service behind the tools is real; flights are
written down.
"""

from __future__ import annotations

import contextlib
import json
import random
import re
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import anyio
import anyio.to_thread
import pytest
from anyio.abc import TaskStatus
from mcp import Client, MCPError

from aerodaas.config.redaction import catalogue
from aerodaas.errors import AeroDaaSError
from aerodaas.extensions.agents.caller import Call, Caller
from aerodaas.extensions.agents.server import AgentServer
from aerodaas.protocol.proposals import ApprovalIn
from aerodaas.protocol.schemas import MissionPhase, NavigationIn
from aerodaas.service.flights.folder import FlightFolder
from aerodaas.service.flights.orders import FlightOrder, Outcome
from aerodaas.service.http.limits import RequestLimits
from aerodaas.service.proposals.record import envelope_violation
from tools.fuzz.flight import require
from tools.fuzz.json_changes import VALUES, change_value, flip_byte

sys.path.append(str(Path(__file__).resolve().parents[3] / "tests" / "service"))
sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))

from asked import ADDRESS, AskedProvider
from proposed import AGENT, ENVELOPE, GOOD, OPERATOR, OTHER_AGENT, STRANGER

__all__ = ["mutate", "run", "seeds"]

_LIMITS = RequestLimits(rate=1e9, burst=1e9)
_MOST_STEPS, _MOST_CALLS = 12, 16
_CROWD = 8
"""Calls at once beside which a stop is tried."""
_PAUSE = 0.05
"""Seconds between two turns of the service."""
_BYTES, _CANCELLED = 0.05, 0.3
"""Shares of mutations that change a byte, and of calls by others that are cancelled."""
_LARGEST = 2**18
"""Bytes of an input."""
_LONGEST_REFUSAL = 1200
_STOPS = frozenset({"pause", "return-home", "land"})
_PRESENT = (5.0, 0.0, 2.0)
"""Where the flight is all the time."""
_MOST_ORDERS = 50
"""Flights and rehearsals after which a provider is made anew: its folder would only grow."""
_STOP_SECONDS = 10.0
"""Wall seconds within which a stop answers amid other calls, on a busy machine."""
_INSIDE = re.compile(r"Traceback|File \"|site-packages|/home/|/tmp/|\.py\b|0x[0-9a-f]{6}")
"""What an answer never holds: a trace of the inside."""
_CALLERS = (AGENT.account, OTHER_AGENT.account, STRANGER.account)
_HANDLES = ("$last", "$first", "$flying", "nothing", "../../etc/passwd", "")
_SPECIAL = (
    *_HANDLES,
    "\u202eevil\x00\x1b[31m",
    "x" * 70_000,
    {"$model": "a.onnx"},
    {"$here": 0},
    {"$property": ["one/cam", "width"]},
    [[[[[[]]]]]],
    -0.0,
    2**63,
)


class _Rehearsing(AskedProvider):
    """A provider whose rehearsals end well as soon as they begin."""

    def _start(self, folder: FlightFolder, *, tied: bool, vehicles: bool) -> Any:  # noqa: ANN401
        process = super()._start(folder, tied=tied, vehicles=vehicles)
        if FlightOrder.read(folder.order).rehearsal:
            folder.end(Outcome(landed=True, began=0.0, ended=1.0, verdict=GOOD))
        return process


class _World:
    """A provider with one flight that was approved, and a server of tools for each caller."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="aerodaas-fuzz-")
        self.provider = _Rehearsing(
            Path(self._folder.name), _patch, limits=_LIMITS, hourly_rehearsals=10**9
        )
        mission, self.flight = self.provider.flown()
        self.handles = {"$flying": mission.id, "$first": mission.id, "$last": mission.id}
        self.approved = {FlightOrder.read(self.provider.started[-1].order).mission}
        """Missions that the operator has approved."""
        fleet = catalogue(self.provider.settings.config)
        self.servers = {
            name: AgentServer(_always(Caller(self.provider.client(name), ADDRESS, name)), fleet)
            for name in _CALLERS
        }

    @property
    def worn(self) -> bool:
        """Whether it has had so many rehearsals and flights that its folder would only grow."""
        return len(self.provider.started) > _MOST_ORDERS

    def close(self) -> None:
        """Leave nothing behind."""
        self.provider.store.close()
        self._folder.cleanup()

    def advance(self) -> None:
        """Let the service move on."""
        self.flight.is_at(_PRESENT)
        self.provider.turns(1)

    def approve(self) -> None:
        """Have the operator approve what waits for it."""
        operator = self.provider.client(OPERATOR.account)
        for mission in operator.missions():
            if mission.phase is MissionPhase.AWAITING_APPROVAL and mission.proposal is not None:
                self.approved.add(mission.id)
                with contextlib.suppress(AeroDaaSError):  # it has lapsed, or moves an actuator
                    operator.approve(mission.id, ApprovalIn(hash=mission.proposal.hash))
        self.advance()

    def cancel(self) -> None:
        """Cancel what waits, so that the next input may propose as well."""
        for name in _CALLERS:
            client = self.provider.client(name)
            for mission in client.missions():
                if not mission.phase.over and mission.id != self.handles["$flying"]:
                    with contextlib.suppress(AeroDaaSError):
                        client.cancel(mission.id)

    def check(self) -> None:
        """Raise AssertionError for a flight that nobody approved, or a command that is none's."""
        for order in self.provider.flights:
            require(order.mission in self.approved, f"{order.mission} flies without an approval")
        for command in self.flight.asked:
            if isinstance(command, NavigationIn):
                places = [_PRESENT, *((one.x, one.y, one.z) for one in command.waypoints)]
                require(not envelope_violation(ENVELOPE, places, 0.0), f"it flies to {places}")
            else:
                require(command.command in _STOPS, f"the flight was told {command}")
        self.flight.asked.clear()


_patch = pytest.MonkeyPatch()
_worlds: list[_World] = []
"""The world of all inputs, until it is worn."""


def _always(caller: Caller) -> Callable[[Call], Caller]:
    return lambda _: caller


def seeds() -> Iterable[bytes]:
    """The way of a good mission, its interruptions, and sixteen calls at once."""
    place = {"id": "a", "x": 5, "y": 5, "z": 3, "heading_compass_deg": 90}
    head: dict[str, Any] = {"format": "aerodaas-mission", "version": 1, "name": "visits"}
    document = {**head, "navigation": [{"robot": "two", "waypoints": [place]}]}
    follow = {
        **head,
        "sensors": ["one/cam"],
        "analyses": [
            {"id": "one/people", "analysis": "VipDetectionAnalytics", "reads": ["one/cam"]},
            {
                "id": "one/follow",
                "analysis": "VipFollowAnalytics",
                "reads": ["one/people"],
                "settings": {"distance": 3},
            },
        ],
        "navigation": [{"robot": "one", "stream": "one/follow"}],
    }
    propose = _call("propose", document=document, why="to look")
    change = _call("change", id="$flying", robot="one", waypoints=[place], why="wind")
    looks = [
        _call("mission", id="$flying"),
        _call("fleet"),
        _call("watch", id="$flying", seconds=1),
    ]
    asks = [_call(tool, proposal="$last") for tool in ("check", "rehearse", "request_approval")]
    stop = _call("stop", id="$last", how="hold")
    yield _written([propose], *([one] for one in asks), "approved", looks, [stop])
    yield _written([_call("propose", document=follow, why="")], [asks[0]], [asks[2]], looks)
    yield _written([change], "advance", [_call("stop", id="$flying", how="land")], [change, change])
    yield _written([propose] * 8 + looks + asks + [stop], [stop], [_call("results", id="$last")])
    foreign = [{**one, "by": STRANGER.account} for one in (*looks, *asks, stop, change)]
    yield _written([propose], foreign, [{**one, "cancel": True} for one in (*asks, propose)])
    topics = ("missions", "analyses", "document", "analysis:VipFollow", "conditions")
    yield _written([_call("catalogue", topic=topic) for topic in topics])


def _call(tool: str, **arguments: object) -> dict[str, Any]:
    return {"tool": tool, "arguments": arguments}


def _written(*steps: object) -> bytes:
    return json.dumps(steps).encode()


def run(data: bytes) -> None:
    """Make the calls, and look at each answer and at what flies."""
    try:
        steps = json.loads(data)
    except (ValueError, RecursionError):
        return
    if not isinstance(steps, list):
        return
    if not _worlds or _worlds[0].worn:
        for world in _worlds:
            world.close()
        _worlds[:] = [_World()]
    (world,) = _worlds
    try:
        anyio.run(_play, world, steps[:_MOST_STEPS])
    except Exception as error:  # noqa: BLE001 - raised again
        cause: Any = error
        while exceptions := getattr(cause, "exceptions", ()):  # of a group of tasks
            cause = exceptions[0]
        raise cause from None
    world.check()
    world.cancel()


async def _play(world: _World, steps: list[Any]) -> None:
    async with contextlib.AsyncExitStack() as stack:
        clients = {
            name: await stack.enter_async_context(Client(server, raise_exceptions=False))
            for name, server in world.servers.items()
        }
        for step in steps:
            if step == "approved":
                await anyio.to_thread.run_sync(world.approve)
            calls = [one for one in step if isinstance(one, dict)] if isinstance(step, list) else []
            async with anyio.create_task_group() as group:
                rest = await group.start(_advance, world)
                async with anyio.create_task_group() as together:
                    for call in calls[:_MOST_CALLS]:
                        together.start_soon(_made, world, clients, call)
                    if len(calls) >= _CROWD:
                        together.start_soon(_stopped, clients[AGENT.account], world)
                rest.cancel()


async def _advance(world: _World, *, task_status: TaskStatus[anyio.CancelScope]) -> None:
    """Let the service move on beside the calls."""
    with anyio.CancelScope() as scope:
        task_status.started(scope)
        while True:
            await anyio.to_thread.run_sync(world.advance)
            await anyio.sleep(_PAUSE)


async def _stopped(client: Client, world: _World) -> None:
    """A stop answers, however many other calls are under way."""
    with anyio.fail_after(_STOP_SECONDS):
        arguments = {"id": world.handles["$flying"], "how": "hold"}
        answer = await client.call_tool("stop", arguments)
    require(not answer.is_error, f"stop was refused: {answer.content}")
    robots = (answer.structured_content or {})["robots"]
    require(all(robot["accepted"] for robot in robots), f"stop did not stop: {robots}")


async def _made(world: _World, clients: dict[str, Client], call: dict[str, Any]) -> None:
    """Make one call, and look at its answer."""
    tool, arguments = str(call.get("tool")), call.get("arguments")
    given = _resolved(world, arguments) if isinstance(arguments, dict) else {}
    if tool == "watch" and isinstance(given.get("seconds", 30.0), int | float):
        given["seconds"] = min(given.get("seconds", 1.0), 1.0)
    client = clients.get(str(call.get("by")), clients[AGENT.account])
    seconds = 0.001 if call.get("cancel") else 60.0
    with anyio.move_on_after(seconds):
        try:
            answer = await client.call_tool(tool, given)
        except MCPError as error:
            _look(world, tool, str(error))
            return
        told = json.dumps(answer.model_dump(mode="json"), ensure_ascii=False)
        _look(world, tool, told)
        content = answer.structured_content or {}
        handle = content.get("proposal") or content.get("mission")
        if isinstance(handle, str) and call.get("by") is None:
            world.handles["$last"] = handle
        if answer.is_error:
            (first, *_) = answer.content
            text = getattr(first, "text", "")
            require(len(text) <= _LONGEST_REFUSAL, f"{tool} refuses with {len(text)} characters")
            require(text != f"Error executing tool {tool}", f"{tool} crashed with {given!r:.500}")


def _look(world: _World, tool: str, told: str) -> None:
    """Raise AssertionError for an answer with a trace of the inside or a secret."""
    found = _INSIDE.search(told)
    where = told[max(0, found.start() - 100) : found.end() + 100] if found else ""
    require(found is None, f"{tool} tells of the inside: {where}")
    secrets = world.provider.tokens.values()
    require(not any(secret in told for secret in secrets), f"{tool} tells a token")


def _resolved(world: _World, value: Any) -> Any:  # noqa: ANN401 - JSON
    """Arguments with the handles of earlier answers."""
    if isinstance(value, dict):
        return {key: _resolved(world, one) for key, one in value.items()}
    if isinstance(value, list):
        return [_resolved(world, one) for one in value]
    return world.handles.get(value, value) if isinstance(value, str) else value


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Change values, repeat, exchange and gather calls, and one byte now and then."""
    try:
        steps = json.loads(data)
    except (ValueError, RecursionError):
        return flip_byte(data, rng)
    if not isinstance(steps, list) or rng.random() < _BYTES:
        return flip_byte(data, rng)
    for _ in range(rng.randrange(1, 4)):
        change = rng.choice(("value", "value", "value", "repeat", "shuffle", "gather", "by"))
        calls = [one for step in steps if isinstance(step, list) for one in step]
        if change == "value" or not calls:
            change_value(steps, rng, (*VALUES, *_SPECIAL))
        elif change == "repeat":
            steps.insert(rng.randrange(len(steps) + 1), rng.choice(steps))
        elif change == "shuffle":
            rng.shuffle(steps)
        elif change == "gather":
            steps.append([rng.choice(calls) for _ in range(_MOST_CALLS)])
        elif isinstance(found := rng.choice(calls), dict):
            found["by"] = rng.choice(_CALLERS)
            found["cancel"] = rng.random() < _CANCELLED
        try:
            data = json.dumps(steps).encode()
        except (ValueError, RecursionError):  # it holds itself
            break
        steps = json.loads(data)
    return data[:_LARGEST] if len(data) > _LARGEST else data

"""A stand-in of the service behind the tools, and clients of the tools in this process."""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import anyio
import pytest
from robot_statuses import robot_status

from aerodaas.config.model import EnvironmentConfig, validated
from aerodaas.config.redaction import catalogue
from aerodaas.environment.provider.address import ServiceAddress
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import MissionError
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import ChangeIn, CheckReport, ProposalIn, ProposalOut
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import (
    CommandIn,
    FleetOut,
    MissionOut,
    MissionPhase,
    RobotOut,
    VerdictOut,
)

pytest.importorskip("mcp", reason="the extra `agents` is not installed")

from mcp import Client

from aerodaas.extensions.agents.caller import Caller
from aerodaas.extensions.agents.server import AgentServer

T = TypeVar("T")
MODES = ("auto", "legacy")
"""The two ways in which a client begins: by discovery, and by a handshake."""
FLEET: dict[str, Any] = {
    "name": "field",
    "robots": [
        {
            "id": "drone",
            "start": [1, 2, 0],
            "sensors": [{"id": "cam", "type": "camera"}, {"id": "odom", "type": "odometry"}],
            "limits": {
                "geofence": {
                    "polygon": [[-20, -20], [30, -20], [30, 30], [-20, 30]],
                    "ceiling": 15,
                },
                "max_speed": 4,
            },
        }
    ],
    "compute": [{"id": "edge", "kind": "edge"}],
    "simulation": {"world": "empty"},
}


def fleet(content: dict[str, Any] = FLEET) -> EnvironmentConfig:
    """Catalogue of a fleet."""
    return catalogue(validated(content, "the fleet"))


def document(*waypoints: dict[str, Any], **changes: object) -> dict[str, Any]:
    """A mission document in the tools' frame."""
    return {
        "format": "aerodaas-mission",
        "version": 1,
        "name": "visits",
        "navigation": [{"robot": "drone", "waypoints": list(waypoints)}],
        **changes,
    }


class Service:
    """What the tools ask; `proposed`, `commands` and `changes` hold what it was asked."""

    def __init__(self) -> None:
        self.address = ServiceAddress.parse("http://127.0.0.1:8400")
        self.proposed: list[ProposalIn] = []
        self.commands: list[tuple[str, str]] = []
        self.changes: list[ChangeIn] = []
        self.refused_calls: list[tuple[str, str]] = []
        self.refusal: Exception | None = None
        self.missions: dict[str, MissionOut] = {}
        self.slow: threading.Event | None = None
        """What the fleet's answer waits for."""
        self.waiting = 0
        """How often the fleet was asked for while its answer waits."""
        self._lock = threading.Lock()
        self.looks: list[Callable[[], object]] = []
        """What happens before the next looks at a mission, one each."""

    def fleet(self) -> FleetOut:
        """One drone that was heard of nine seconds ago."""
        if self.slow is not None:
            with self._lock:
                self.waiting += 1
            self.slow.wait(60)
        shown = fleet().model_dump(mode="json", by_alias=True)
        robot = RobotOut(
            id="drone",
            sensors=["drone/cam"],
            battery=0.8,
            position=(1.0, 2.0, 0.0),
            heard=time.time() - 9.0,
        )
        return FleetOut(name="field", robots=[robot], environment=shown)

    def fleet_scenery(self) -> SceneryOut:
        """An empty field."""
        return SceneryOut()

    def propose(self, proposal: ProposalIn) -> MissionOut:
        """Keep it."""
        if self.refusal is not None:
            raise self.refusal
        self.proposed.append(proposal)
        kept = ProposalOut(hash="0" * 64, document=proposal.document, minutes=proposal.minutes)
        return self.put("p1", phase=MissionPhase.PROPOSED, proposal=kept)

    def check(self, proposal: str) -> CheckReport:
        """Nothing to find."""
        self.mission(proposal)
        return CheckReport(passed=True)

    def rehearse(self, proposal: str, seeds: int) -> MissionOut:
        """Begin, and be done at the second look."""
        verdict = VerdictOut(approved=True, seeds=list(range(seeds)), picture="/x.png")
        self.looks = [
            lambda: None,
            lambda: self.change_mission(proposal, phase=MissionPhase.PROPOSED, verdict=verdict),
        ]
        return self.change_mission(proposal, phase=MissionPhase.REHEARSING)

    def request_approval(self, proposal: str) -> MissionOut:
        """Wait for a person."""
        return self.change_mission(proposal, phase=MissionPhase.AWAITING_APPROVAL)

    def mission(self, mission: str) -> MissionOut:
        """As it is by now."""
        if self.looks:
            self.looks.pop(0)()
        if mission not in self.missions:
            raise MissionError(f"127.0.0.1: there is no mission {mission} at http://127.0.0.1:8400")
        return self.missions[mission]

    def cancel(self, mission: str) -> MissionOut:
        """Withdraw it."""
        return self.change_mission(mission, phase=MissionPhase.CANCELLED)

    def report_refused_call(self, tool: str, text: str) -> None:
        """Keep it."""
        self.refused_calls.append((tool, text))

    def command(self, mission: str, command: CommandIn) -> Answer:
        """Obey, if there is such a drone."""
        if command.robot != "drone":
            raise MissionError(f"127.0.0.1: {mission} has no {command.robot} in the air")
        self.commands.append((command.robot, command.command))
        return Answer(accepted=True, text="holding")

    def change(self, mission: str, wanted: ChangeIn) -> MissionOut:
        """Ask a person."""
        self.changes.append(wanted)
        return self.put("c1", phase=MissionPhase.AWAITING_APPROVAL, reason=f"changes {mission}")

    def rehearsal_picture(self, mission: str, target: Path) -> None:
        """A picture of sorts."""
        del mission
        target.write_bytes(b"\x89PNG")

    def put(self, id_: str, **fields: Any) -> MissionOut:  # noqa: ANN401
        """Have a mission."""
        given = {"id": id_, "name": "m", "tenant": "t", "account": "a", "robots": ["drone"]}
        self.missions[id_] = MissionOut(**{**given, "submitted": 0.0, **fields})
        return self.missions[id_]

    def change_mission(self, id_: str, **fields: Any) -> MissionOut:  # noqa: ANN401
        """Have a mission go on."""
        self.missions[id_] = self.mission(id_).model_copy(update=fields)
        return self.missions[id_]

    def fly(self, id_: str = "m1", **status: Any) -> MissionOut:  # noqa: ANN401
        """Have a flying mission, with this status of its drone."""
        told = {"drone": time.time()}
        robots = {"drone": robot_status(**status)}
        return self.put(id_, phase=MissionPhase.FLYING, status=robots, told=told)


_answering: list[Service] = []
"""The stand-in that the server asks at present: a server takes long to make."""


@functools.cache
def _server() -> AgentServer:
    return AgentServer(
        lambda _: Caller(cast("ProviderClient", _answering[-1]), "http://127.0.0.1:8400"), fleet()
    )


def played(service: Service, script: Callable[[Client], Awaitable[T]], mode: str = MODES[0]) -> T:
    """Run a script of calls; returns what it returned."""

    async def play() -> T:
        async with Client(_server(), mode=mode) as client:
            return await script(client)

    _answering[:] = [service]
    return anyio.run(play)


def called(service: Service, tool: str, mode: str = MODES[0], **arguments: object) -> Any:  # noqa: ANN401
    """Call one tool; returns its structured answer, or the text of its refusal."""

    async def call(client: Client) -> Any:  # noqa: ANN401
        found = await client.call_tool(tool, arguments)
        (first, *_) = found.content
        return getattr(first, "text", "") if found.is_error else found.structured_content

    return played(service, call, mode)

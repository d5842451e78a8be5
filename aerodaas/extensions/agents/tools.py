"""The eleven tools: each asks the service as the account that calls, and answers in one frame."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias, TypeVar

import anyio
import anyio.to_thread
from mcp.server.mcpserver.exceptions import ToolError
from mcp.types import CallToolResult, ImageContent, TextContent
from pydantic import BaseModel, Field

from aerodaas.config.checked import checked
from aerodaas.config.model import EnvironmentConfig
from aerodaas.dataflow.mission_document import DocumentWaypoint, MissionDocument
from aerodaas.environment.provider.client import ProviderClient
from aerodaas.errors import AeroDaaSError, ConfigError
from aerodaas.extensions.agents import recorded
from aerodaas.extensions.agents.answers import (
    Change,
    FleetAnswer,
    MissionAnswer,
    ProposalAnswer,
    RehearsalAnswer,
    ResultsAnswer,
    StopAnswer,
    StoppedRobot,
    Topic,
    WatchAnswer,
)
from aerodaas.extensions.agents.caller import Call, Callers, refusal
from aerodaas.extensions.agents.catalogue import TOPICS, topic_of
from aerodaas.extensions.agents.frames import document_waypoints
from aerodaas.extensions.agents.schema import AsJson
from aerodaas.extensions.agents.text import plain, world
from aerodaas.messages.mission import MissionState
from aerodaas.protocol.proposals import ChangeIn, CheckReport, ProposalIn
from aerodaas.protocol.schemas import CommandIn, CommandWord, MissionOut, MissionPhase

__all__ = ["AgentTools"]

M = TypeVar("M", bound=BaseModel)
_EVERY = 0.5
"""Seconds between two looks at a mission that is watched."""
_REHEARSAL_SECONDS = 300.0
"""Seconds that one call waits for a rehearsal."""
_LONGEST = 1000
"""Characters of a refusal."""
_STOPS: dict[str, CommandWord] = {"hold": "pause", "return": "return-home", "land": "land"}
_UNDECIDED = frozenset(
    {MissionPhase.PROPOSED, MissionPhase.REHEARSING, MissionPhase.AWAITING_APPROVAL}
)
Document: TypeAlias = Annotated[
    dict[str, Any],
    AsJson(MissionDocument),
    Field(description="The mission, whole. catalogue('missions') has examples."),
]
Waypoints: TypeAlias = Annotated[
    list[dict[str, Any]],
    AsJson(list[DocumentWaypoint]),
    Field(description="They replace all that lie ahead of the drone."),
]
Id: TypeAlias = Annotated[str, Field(min_length=1, max_length=64, description="Id of a mission.")]
Proposal: TypeAlias = Annotated[
    str, Field(min_length=1, max_length=64, description="Handle of `propose`.")
]
Why: TypeAlias = Annotated[
    str, Field(max_length=500, description="The reason, which the approver reads.")
]


class AgentTools:
    """Tools of one server; each docstring is what a model reads of the tool."""

    def __init__(self, callers: Callers, fleet: EnvironmentConfig) -> None:
        """Ask by `callers`; `fleet` is the catalogue of the fleet."""
        self._callers = callers
        self._fleet = fleet

    async def catalogue(
        self, topic: Annotated[str, Field(max_length=100, description=", ".join(TOPICS))]
    ) -> Topic:
        """List parts of a mission: examples, analyses and their arguments, the schema."""
        try:
            return await anyio.to_thread.run_sync(topic_of, topic, self._fleet)
        except ConfigError as error:
            raise ToolError(str(error)) from None

    async def fleet(self, call: Call) -> FleetAnswer:
        """The drones: place, charge and their age, fence, heights, speeds, sensors, obstacles.

        Read it before you propose: what lies outside these bounds is refused.
        """
        fleet, scenery = await self._callers.ask(
            call, lambda client: (client.fleet(), client.fleet_scenery())
        )
        return FleetAnswer.of(fleet, scenery)

    async def propose(
        self,
        call: Call,
        document: Document,
        why: Why,
        parent: Annotated[
            str | None, Field(max_length=64, description="Proposal that this one changes.")
        ] = None,
        minutes: Annotated[
            float, Field(gt=0, le=1440, description="For which the drones are asked.")
        ] = 15.0,
    ) -> ProposalAnswer:
        """Keep a mission document as a proposal; nothing flies by it.

        Returns the handle for check, rehearse and request_approval, which lasts as long as the
        service keeps the proposal. The same call twice is one proposal.
        """
        content = {"document": document, "minutes": minutes, "parent": parent, "why": why}
        proposal = _checked(ProposalIn, content)
        return ProposalAnswer.of(
            await self._callers.ask(call, lambda client: client.propose(proposal))
        )

    async def check(self, call: Call, proposal: Proposal) -> CheckReport:
        """Check a proposal without flying, within a second: each finding with its remedy."""
        return await self._callers.ask(call, lambda client: client.check(proposal))

    async def rehearse(
        self,
        call: Call,
        proposal: Proposal,
        seeds: Annotated[
            int, Field(ge=1, le=5, description="Flights, each with other gusts and noise.")
        ] = 3,
    ) -> RehearsalAnswer:
        """Fly a proposal in simulation from the present charge; nothing real moves.

        Takes up to minutes. `passed` is null where it takes longer: call again.
        """
        mission = await self._callers.ask(call, lambda client: client.rehearse(proposal, seeds))
        began = anyio.current_time()
        while mission.phase is MissionPhase.REHEARSING:
            seconds = anyio.current_time() - began
            if seconds > _REHEARSAL_SECONDS:
                break
            await call.report_progress(round(seconds, 1), None, "flying in simulation")
            await anyio.sleep(_EVERY)
            mission = await self._mission(call, proposal)
        return RehearsalAnswer.of(mission)

    async def request_approval(self, call: Call, proposal: Proposal) -> MissionAnswer:
        """Ask a person to approve a rehearsed proposal; you cannot approve it yourself.

        Give the person the `link`, then watch the mission until "decision". An approval is good
        for this document alone, for ten minutes and one flight.
        """
        mission = await self._callers.ask(call, lambda client: client.request_approval(proposal))
        return self._answer(call, mission)

    async def mission(self, call: Call, id: Id) -> MissionAnswer:  # noqa: A002 - its name to models
        """A mission's phase, and the measured state of its drones with its age in seconds.

        It is done when `landed` is true, and never before.
        """
        return self._answer(call, await self._mission(call, id))

    async def watch(
        self,
        call: Call,
        id: Id,  # noqa: A002 - its name to models
        until: Annotated[
            Literal["change", "decision", "over"],
            Field(
                description="`change` of phase, drone's state, alerts or waypoints; a person's "
                "`decision`; or until the mission is `over`. An alert ends each."
            ),
        ] = "change",
        seconds: Annotated[float, Field(ge=1, le=60)] = 30.0,
    ) -> WatchAnswer:
        """Wait for the next thing that matters in a mission, for at most so many seconds.

        Call it again and again until `landed`: a mission goes on while nobody watches.
        """
        first = mission = await self._mission(call, id)
        began = anyio.current_time()
        while True:
            changed, elapsed = _changes(first, mission), anyio.current_time() - began
            if elapsed >= seconds or _is_due(until, mission, changed):
                break
            await call.report_progress(round(elapsed, 1), seconds, mission.phase.value)
            await anyio.sleep(min(_EVERY, seconds - elapsed))
            mission = await self._mission(call, id)
        answer = self._answer(call, mission)
        return WatchAnswer(changed=changed, seconds=round(elapsed, 1), mission=answer)

    async def stop(
        self,
        call: Call,
        id: Id,  # noqa: A002 - its name to models
        how: Annotated[
            Literal["hold", "return", "land"],
            Field(description="Hover in place, come home and land, or land where it is."),
        ],
    ) -> StopAnswer:
        """Stop a mission at once; needs no approval. Only a person can resume it.

        Before take-off it is withdrawn, whatever `how` says.
        """

        def stopped(client: ProviderClient) -> StopAnswer:
            mission = client.mission(id)
            if mission.phase is not MissionPhase.FLYING:
                if not mission.phase.over:
                    mission = client.cancel(id)
                return StopAnswer(
                    mission=id, withdrawn=mission.phase is MissionPhase.CANCELLED, robots=[]
                )
            robots = [_stopped(client, id, robot, _STOPS[how]) for robot in mission.robots]
            return StopAnswer(mission=id, withdrawn=False, robots=robots)

        return await self._callers.ask(call, stopped, urgent=True)

    async def change(
        self,
        call: Call,
        id: Id,  # noqa: A002 - its name to models
        robot: Annotated[str, Field(min_length=1, max_length=64, description="Id of the drone.")],
        waypoints: Waypoints,
        why: Why,
    ) -> MissionAnswer:
        """Change the waypoints of a drone in flight: rehearsed from where it is now.

        Within what the approver allowed beforehand it is done; otherwise a person is asked again.
        The answer is the change's own mission: watch it until "decision".
        """
        request = _checked(ChangeIn, {"robot": robot, "waypoints": waypoints, "why": why})
        mission = await self._callers.ask(call, lambda client: client.change(id, request))
        return self._answer(call, mission)

    async def results(
        self,
        call: Call,
        id: Id,  # noqa: A002 - its name to models
        part: Annotated[
            str,
            Field(
                pattern="^(report|detections|pictures|picture:.{1,100})$",
                description="report, detections, pictures (a list of ids), or picture:ID",
            ),
        ] = "report",
    ) -> Annotated[CallToolResult, ResultsAnswer]:
        """Results of a mission that is over: figures, detections as numbers, small pictures.

        Detections and pictures need a token for sensing.
        """
        mission = await self._mission(call, id)
        if not mission.phase.over:
            raise ToolError(f"the mission is {mission.phase.value}: watch it until it is over")
        answer = ResultsAnswer.of(mission)
        content: list[Any] = []
        if part != "report":
            found, image = await self._callers.ask(call, lambda client: _recorded(client, id, part))
            answer = answer.model_copy(update=found)
            if image:
                content.append(ImageContent(type="image", data=image, mime_type="image/jpeg"))
        content.insert(0, TextContent(type="text", text=answer.model_dump_json()))
        return CallToolResult(
            content=content, structured_content=answer.model_dump(mode="json", by_alias=True)
        )

    async def _mission(self, call: Call, mission: str) -> MissionOut:
        return await self._callers.ask(call, lambda client: client.mission(mission))

    def _answer(self, call: Call, mission: MissionOut) -> MissionAnswer:
        return MissionAnswer.of(mission, self._callers.of(call).link(mission.id))


def _stopped(
    client: ProviderClient, mission: str, robot: str, command: CommandWord
) -> StoppedRobot:
    try:
        answer = client.command(mission, CommandIn(robot=robot, command=command))
    except AeroDaaSError as error:
        # The other drones are stopped all the same.
        return StoppedRobot(robot=robot, accepted=False, text=world(refusal(error, client)))
    return StoppedRobot(robot=robot, accepted=answer.accepted, text=world(answer.text))


def _recorded(client: ProviderClient, mission: str, part: str) -> tuple[dict[str, Any], str]:
    """Fields of an answer that a recording gives, and a picture as base64."""
    with recorded.recording_of(client, mission) as recording:
        if part == "detections":
            return {"detections": recorded.found_labels(recording)}, ""
        if part == "pictures":
            return {"pictures": recorded.pictures(recording)}, ""
        image = recorded.picture(recording, part.partition(":")[2])
        return {}, base64.b64encode(image).decode()


def _checked(model: type[M], content: Mapping[str, Any]) -> M:
    """A request of a tool's arguments; raises ToolError that names field and remedy."""
    found = dict(content)
    try:
        if "document" in found:
            found["document"] = _converted(found["document"])
        else:
            found["waypoints"] = document_waypoints(found["waypoints"], "waypoints")
        return checked(model, found, "this is refused")
    except ConfigError as error:
        raise ToolError(plain(str(error), _LONGEST)) from None


def _converted(document: Mapping[str, Any]) -> dict[str, Any]:
    """A document as the service reads it, of one in the tools' frame; raises ConfigError."""
    navigation = document.get("navigation")
    if not isinstance(navigation, list):
        return dict(document)
    converted = [
        {**one, "waypoints": document_waypoints(one["waypoints"], f"navigation.{number}.waypoints")}
        if isinstance(one, dict) and "waypoints" in one
        else one
        for number, one in enumerate(navigation)
    ]
    return {**document, "navigation": converted}


def _changes(first: MissionOut, now: MissionOut) -> list[Change]:
    """Changes between two states of a mission that matter to its watcher."""
    found: list[Change] = []
    if now.phase is not first.phase:
        found.append("phase")
    if now.alerts != first.alerts:
        found.append("alert")
    before, after = _progress(first), _progress(now)
    kinds: tuple[Change, Change] = ("robot_state", "waypoint_visited")
    for index, change in enumerate(kinds):
        if any(one[index] != before.get(key, (None, 0))[index] for key, one in after.items()):
            found.append(change)
    return found


def _progress(mission: MissionOut) -> dict[str, tuple[MissionState | None, int]]:
    """State and number of visited waypoints by robot."""
    robots = mission.status.items()
    return {robot: (one.mission.state, one.mission.visits) for robot, one in robots}


def _is_due(until: str, mission: MissionOut, changed: list[Change]) -> bool:
    """Whether a watch that waits `until` something answers now."""
    if mission.phase.over or "alert" in changed:
        return True
    if until == "decision":
        # What a change of the weather, or time, has undone is proposed again.
        return mission.phase not in _UNDECIDED or "phase" in changed
    return until == "change" and bool(changed)

"""Missions, and what a pilot does with a flying one: commands, waypoints and their order."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, BackgroundTasks, Request

from aerodaas.config.extensions import added
from aerodaas.mission.commands import Answer
from aerodaas.protocol.piloting import ActuateIn, RearrangeIn
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import CommandIn, CommandWord, MissionOut, NavigationIn, Role, Scope
from aerodaas.service.backend import Missions, PilotCommand, ShownMissions
from aerodaas.service.http.bodies import api_router
from aerodaas.service.http.gate import Admission

__all__ = ["MissionRoutes", "PilotingRoutes", "extension_routers"]

_STOPS: frozenset[CommandWord] = frozenset({"pause", "return-home", "land"})
"""Commands after which a robot does less than before: agents may give them, too."""


def extension_routers(missions: Missions, admission: Admission) -> list[APIRouter]:
    """Make the routes that extensions add.

    Args:
        missions: Missions that they are about.
        admission: Access to them.
    """
    return [router(missions, admission) for router in added("routes")]


class MissionRoutes:
    """Routes `/v1/missions`, `/v1/missions/{id}` and `/v1/missions/{id}/scenery`."""

    def __init__(self, missions: ShownMissions, admission: Admission) -> None:
        """Show `missions`."""
        self._missions = missions
        self._admission = admission

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1/missions", "missions")
        router.add_api_route("", self.missions)
        router.add_api_route("/{mission}", self.mission)
        router.add_api_route("/{mission}/scenery", self.scenery)
        return router

    def missions(self, request: Request) -> list[MissionOut]:
        """All missions that the account may see, newest first."""
        return self._missions.missions(self._admission.require(request, Role.VIEWER, agents=True))

    def mission(self, mission: str, request: Request) -> MissionOut:
        """One mission with its newest state; its own user counts as present."""
        return self._missions.mission(
            self._admission.require(request, Role.VIEWER, agents=True), mission
        )

    def scenery(self, mission: str, request: Request) -> SceneryOut:
        """Ground below a mission on the map."""
        return self._missions.scenery(
            self._admission.require(request, Role.VIEWER, agents=True), mission
        )


class PilotingRoutes:
    """Routes `/v1/missions/{id}/commands`, `navigation`, `plan` and `actuators`."""

    def __init__(self, missions: Missions, admission: Admission) -> None:
        """Command `missions`."""
        self._missions = missions
        self._admission = admission

    def router(self) -> APIRouter:
        """The routes."""
        router = api_router("/v1/missions", "missions")
        posted: dict[str, Any] = {"methods": ["POST"]}
        router.add_api_route("/{mission}/commands", self.command, **posted)
        router.add_api_route("/{mission}/navigation", self.navigation, **posted)
        router.add_api_route("/{mission}/plan", self.rearrange, **posted)
        router.add_api_route("/{mission}/actuators", self.actuate, **posted)
        return router

    def command(
        self, mission: str, body: CommandIn, request: Request, later: BackgroundTasks
    ) -> Answer:
        """Give one of the mission's robots a command; answers what the drone said.

        An agent may stop a robot, and nothing else.
        """
        agents = body.command in _STOPS
        return self._fly(mission, body, body.command, request, later, agents=agents)

    def navigation(
        self, mission: str, body: NavigationIn, request: Request, later: BackgroundTasks
    ) -> Answer:
        """Add waypoints to the queue of one of the mission's robots."""
        return self._fly(mission, body, "navigation", request, later)

    def rearrange(
        self, mission: str, body: RearrangeIn, request: Request, later: BackgroundTasks
    ) -> Answer:
        """Change the order of a robot's coming waypoints, or remove some."""
        return self._fly(mission, body, "plan", request, later)

    def actuate(
        self, mission: str, body: ActuateIn, request: Request, later: BackgroundTasks
    ) -> Answer:
        """Move an actuator that the account may move."""
        return self._fly(mission, body, "actuate", request, later, f"/{body.actuator}")

    def _fly(
        self,
        mission: str,
        body: PilotCommand,
        action: str,
        request: Request,
        later: BackgroundTasks,
        part: str = "",
        *,
        agents: bool = False,
    ) -> Answer:
        """Have a robot do what its pilot asks; audited as `action` on the robot, or its `part`."""
        principal = self._admission.require(request, Role.PILOT, Scope.FLY, agents=agents)
        with self._admission.auditing(principal, request):
            answer = self._missions.fly(principal, mission, body)
        target = f"{mission}/{body.robot}{part}"
        later.add_task(self._admission.note_answer, principal, action, target, answer)
        return answer

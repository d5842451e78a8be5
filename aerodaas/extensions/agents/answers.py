"""Answers of the tools: typed, in one frame and one set of units, with their age.

Places are metres east, north and up of home, headings compass degrees, times seconds, speeds m/s,
charges 0 to 1. Text that others have written is `Untrusted`.
"""

from __future__ import annotations

import math
import time
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from aerodaas.config.model import EnvironmentConfig
from aerodaas.config.sections.robot import GeofenceConfig
from aerodaas.extensions.agents.frames import FRAMES, heading_of_yaw, tool_waypoints
from aerodaas.extensions.agents.text import Untrusted, untrusted, world
from aerodaas.geometry.frames import length
from aerodaas.messages.mission import Place, RobotStatus
from aerodaas.protocol.proposals import ClearanceOut
from aerodaas.protocol.scenery import SceneryOut
from aerodaas.protocol.schemas import FleetOut, MissionOut, MissionPhase, RobotOut
from aerodaas.simulation.ground_plan import Shape

__all__ = [
    "Change",
    "FleetAnswer",
    "FoundLabel",
    "MissionAnswer",
    "Picture",
    "ProposalAnswer",
    "RehearsalAnswer",
    "ResultsAnswer",
    "StopAnswer",
    "StoppedRobot",
    "Topic",
    "WatchAnswer",
]

_MOST_OBSTACLES = 200
Change = Literal["phase", "alert", "robot_state", "waypoint_visited"]


class _Answer(BaseModel):
    model_config = ConfigDict(frozen=True, from_attributes=True)


class Topic(_Answer):
    """One topic of the catalogue."""

    topic: str
    text: list[str] = Field(default_factory=list)
    names: list[str] = Field(default_factory=list)
    """Names that a document may have here."""
    content: dict[str, Any] = Field(default_factory=dict)
    """Schema or examples, as JSON."""


class RobotLimits(_Answer):
    """Bounds of one drone, which it keeps whatever is asked."""

    geofence: GeofenceConfig
    max_range: float
    cruise_speed: float
    max_speed: float
    battery_return: float


class FleetRobot(_Answer):
    """One drone of the fleet, as it was heard of last."""

    robot: str
    sensors: list[str]
    """Full ids, as a document names them."""
    limits: RobotLimits
    start: Place | None
    """Where it stands before its first flight."""
    ready: bool
    """Whether nothing speaks against a flight now."""
    objection: Untrusted | None
    leased: bool
    place: Place | None
    battery: float | None
    age_s: float | None
    """Seconds since place and battery were heard; None if never."""

    @classmethod
    def of(cls, robot: RobotOut, catalogue: EnvironmentConfig) -> FleetRobot:
        """Convert a drone of the service, with its limits from the fleet's catalogue."""
        config = next(one for one in catalogue.robots if one.id == robot.id)
        return cls(
            robot=robot.id,
            sensors=robot.sensors,
            limits=RobotLimits.model_validate(config.limits),
            start=config.start,
            ready=robot.enabled and not robot.objection and robot.mission is None,
            objection=world(robot.objection),
            leased=robot.lease is not None,
            place=_rounded(robot.position),
            battery=robot.battery,
            age_s=_age(robot.heard),
        )


class FleetAnswer(_Answer):
    """The drones, their bounds, and what is known of the ground."""

    name: Untrusted | None
    frame: list[str]
    robots: list[FleetRobot]
    obstacles: list[Shape]
    """Things on the ground, without their heights."""
    compute: list[str]
    """Ids of the nodes that run analyses."""

    @classmethod
    def of(cls, fleet: FleetOut, scenery: SceneryOut) -> FleetAnswer:
        """Convert a fleet of the service."""
        catalogue = EnvironmentConfig.model_validate(fleet.environment)
        compute = () if catalogue.compute == "auto" else catalogue.compute
        return cls(
            name=world(fleet.name),
            frame=list(FRAMES),
            robots=[FleetRobot.of(one, catalogue) for one in fleet.robots],
            obstacles=scenery.shapes[:_MOST_OBSTACLES],
            compute=[one.id for one in compute],
        )


class ProposalAnswer(_Answer):
    """A kept proposal; nothing flies by it."""

    proposal: str
    """Handle for the other tools; a name, not a right."""
    hash: str
    """SHA-256 of what would be approved; another document or verdict has another."""
    phase: MissionPhase
    summary: list[str]
    difference: list[str]
    records: list[str]
    """Cameras that run, and analyses of people."""
    actuators: list[str]
    document: dict[str, Any]
    """As it would fly: yaw in radians counter-clockwise from east, and heading_compass_deg."""

    @classmethod
    def of(cls, mission: MissionOut) -> ProposalAnswer:
        """Convert a proposed mission; raises ValueError for one without a proposal."""
        proposal = mission.proposal
        if proposal is None:
            raise ValueError("this mission was submitted to be flown, and not proposed")
        document = proposal.document.model_dump(mode="json", exclude_defaults=True)
        for one in document.get("navigation", ()):
            if "waypoints" in one:
                one["waypoints"] = tool_waypoints(one["waypoints"])
        return cls(
            proposal=mission.id,
            hash=proposal.hash,
            phase=mission.phase,
            summary=proposal.summary,
            difference=proposal.difference,
            records=proposal.records,
            actuators=proposal.actuators,
            document=document,
        )


class RehearsalAnswer(_Answer):
    """Verdict of the flights in simulation."""

    proposal: str
    phase: MissionPhase
    passed: bool | None = None
    """None while it is still being rehearsed: call again."""
    reasons: list[str] = Field(default_factory=list)
    seconds: float | None = None
    distance: float | None = None
    battery_used: float | None = None
    clearance: ClearanceOut | None = None
    """Smallest distance from an object; None in an empty world."""
    seeds: list[int] = Field(default_factory=list)
    picture: str | None = None
    """Resource with a PNG of the flight."""

    @classmethod
    def of(cls, mission: MissionOut) -> RehearsalAnswer:
        """Convert the verdict of a mission, as far as there is one."""
        verdict = mission.verdict
        if verdict is None or mission.phase is MissionPhase.REHEARSING:
            return cls(proposal=mission.id, phase=mission.phase)
        same = {"reasons", "seconds", "distance", "battery_used", "clearance", "seeds"}
        picture = f"aerodaas://mission/{mission.id}/rehearsal.png"
        return cls(
            proposal=mission.id,
            phase=mission.phase,
            passed=verdict.approved,
            picture=None if verdict.picture is None else picture,
            **verdict.model_dump(include=same),
        )


class RobotState(_Answer):
    """State of one drone of a mission, as it was measured last."""

    robot: str
    state: str
    """Such as `enroute`, `returning` or `landed`."""
    age_s: float | None
    """Seconds since the newest report; None once the flight is over."""
    place: Place | None
    heading_compass_deg: float | None
    speed: float | None
    """m/s, climbing included."""
    battery: float | None
    distance: float
    """Metres flown."""
    waypoints_visited: int
    waypoints_known: int
    visited: list[Untrusted]
    """Ids of those reached last."""
    target: Untrusted | None
    reason: Untrusted | None
    faults: list[Untrusted]

    @classmethod
    def all_of(cls, mission: MissionOut) -> list[RobotState]:
        """States of a mission's drones."""
        received = mission.told
        return [cls.of(name, one, received.get(name)) for name, one in mission.status.items()]

    @classmethod
    def of(cls, robot: str, status: RobotStatus, received: float | None) -> RobotState:
        """Convert a status.

        Args:
            robot: Id of the drone.
            status: Its newest status.
            received: Unix seconds when that came; None after the flight.
        """
        mission, vehicle, place = status.mission, status.vehicle, status.place
        odometry = None if vehicle is None or place is None else vehicle.odometry
        visited, known = mission.waypoint_counts
        return cls(
            robot=robot,
            state=mission.state.value,
            age_s=_age(received),
            place=_rounded(place),
            heading_compass_deg=None if odometry is None else _heading(odometry.yaw),
            speed=None if odometry is None else round(length(odometry.velocity), 2),
            battery=None if status.charge is None else round(status.charge, 3),
            distance=round(mission.distance, 1),
            waypoints_visited=visited,
            waypoints_known=known,
            visited=untrusted(mission.visited),
            target=None if mission.target is None else world(mission.target.id),
            reason=world(mission.reason),
            faults=untrusted((*mission.faults, *(vehicle.faults if vehicle else ()))),
        )


class MissionAnswer(_Answer):
    """A mission and the measured state of its drones."""

    mission: str
    phase: MissionPhase
    landed: bool
    """Whether it is over as planned with its drones on the ground; never before."""
    over: bool
    """Whether nothing follows."""
    reason: Untrusted | None
    link: str | None
    """Page on which a person approves it; None while no approval is awaited."""
    approval_lapses_s: int | None
    """Seconds for which its approval is still good for a take-off."""
    robots: list[RobotState]
    alerts: list[Untrusted]

    @classmethod
    def of(cls, mission: MissionOut, link: str) -> MissionAnswer:
        """Convert a mission; `link` is the page on which it is approved."""
        awaits = mission.phase is MissionPhase.AWAITING_APPROVAL
        proposal = mission.proposal if mission.phase is MissionPhase.QUEUED else None
        approval = None if proposal is None else proposal.approval
        return cls(
            mission=mission.id,
            phase=mission.phase,
            landed=mission.phase is MissionPhase.LANDED,
            over=mission.phase.over,
            reason=world(mission.reason),
            link=link if awaits else None,
            approval_lapses_s=None if approval is None else round(approval.lapses - time.time()),
            robots=RobotState.all_of(mission),
            alerts=untrusted(mission.alerts),
        )


class WatchAnswer(_Answer):
    """Changes of a mission, and the mission as it is now."""

    changed: list[Change]
    """Empty: nothing that matters, within the time."""
    seconds: float
    mission: MissionAnswer


class StoppedRobot(_Answer):
    """Answer of one drone to a command."""

    robot: str
    accepted: bool
    text: Untrusted | None


class StopAnswer(_Answer):
    """Result of a stop: each drone's own answer, or a mission withdrawn before it flew."""

    mission: str
    withdrawn: bool
    robots: list[StoppedRobot]


class FoundLabel(_Answer):
    """Detections with one label."""

    label: Untrusted | None
    count: int
    first_s: float
    """Mission seconds of the first frame with it."""
    last_s: float
    best_score: float


class Picture(_Answer):
    """One recorded picture, which the part `picture:ID` shows."""

    id: str
    camera: str
    time_s: float


class ResultsAnswer(_Answer):
    """Part of the results of a mission that is over."""

    mission: str
    phase: MissionPhase
    seconds: float | None
    """From the start to the end of the flight."""
    robots: list[RobotState]
    alerts: list[Untrusted]
    detections: list[FoundLabel] = Field(default_factory=list)
    pictures: list[Picture] = Field(default_factory=list)

    @classmethod
    def of(cls, mission: MissionOut) -> ResultsAnswer:
        """Figures of a mission, of its drones' newest states."""
        started, ended = mission.started, mission.ended
        return cls(
            mission=mission.id,
            phase=mission.phase,
            seconds=None if started is None or ended is None else round(ended - started, 1),
            robots=RobotState.all_of(mission),
            alerts=untrusted(mission.alerts),
        )


def _rounded(place: Place | None) -> Place | None:
    """A place to the centimetre."""
    return None if place is None else (round(place[0], 2), round(place[1], 2), round(place[2], 2))


def _age(moment: float | None) -> float | None:
    return None if moment is None else round(max(0.0, time.time() - moment), 1)


def _heading(yaw: float) -> float | None:
    return round(heading_of_yaw(yaw), 1) if math.isfinite(yaw) else None

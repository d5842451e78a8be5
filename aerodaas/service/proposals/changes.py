"""Changes of missions in flight: other waypoints for one robot, from where it is."""

from __future__ import annotations

import math

import numpy as np

from aerodaas.clock import host_time_ns, seconds
from aerodaas.dataflow.mission_document import MissionDocument, NavigationDocument
from aerodaas.errors import InvalidWaypointError
from aerodaas.geometry.frames import GeodeticOrigin
from aerodaas.messages.mission import MissionState, Place, RobotStatus
from aerodaas.messages.waypoints import Waypoint, WaypointType
from aerodaas.mission.commands import Answer
from aerodaas.protocol.proposals import ApprovalOut, ChangeIn
from aerodaas.protocol.schemas import MissionPhase, NavigationIn, VerdictOut
from aerodaas.service.errors import RefusedError
from aerodaas.service.flights.environment import environment_of
from aerodaas.service.flights.orders import FlightOrder, actuators_of
from aerodaas.service.mission import ActiveMission
from aerodaas.service.proposals.record import envelope_violation

__all__ = ["FlightChanges"]

_CHANGEABLE = frozenset(
    {
        MissionState.HOLDING,
        MissionState.ENROUTE,
        MissionState.LOITERING,
        MissionState.FOLLOWING,
        MissionState.DIVERTED,
    }
)
"""States in which a robot takes other waypoints; who has paused one decides whether it goes on."""
_MINUTE = 60.0
_PRESENT = "present place"
"""Id of the first waypoint of a change: it is rehearsed from home by way of where the robot is."""
_STALE_SECONDS = 5.0
"""Age of a robot's status from which on nobody knows where it is."""


class FlightChanges:
    """Looks at flights that are changed, and changes them.

    A change is rehearsed from its take-off place by way of where it is, with its present charge:
    so it also has the way home, and more way than it needs.
    """

    def document(
        self, host: ActiveMission, change: ChangeIn, allowed: ApprovalOut | None
    ) -> MissionDocument:
        """The document of a change.

        Args:
            host: The mission in flight.
            change: The robot, and its new waypoints.
            allowed: Approval of the mission.

        Raises:
            RefusedError: If the robot does not take other waypoints now, or these cannot be.
        """
        place, _ = self._present(host, change.robot)
        home = environment_of(FlightOrder.read(host.flight.order)).home
        origin = None if home is None else home.origin
        waypoints = [_local(waypoint, origin) for waypoint in change.waypoints]
        entry = NavigationDocument(robot=change.robot, waypoints=waypoints)
        bare: dict[str, object] = {"sensors": [], "analyses": [], "analytics_scheduler": None}
        document = host.document().model_copy(update={**bare, "navigation": [entry]})
        ticked = () if allowed is None else allowed.actuators
        if missing := sorted(actuators_of(document).difference(ticked)):
            raise RefusedError(
                403,
                f"{', '.join(missing)}: not among the actuators that were approved with this "
                "flight, so it does not move them: leave them out",
            )
        return _from(document, place)

    def renewed(self, host: ActiveMission, document: MissionDocument) -> MissionDocument:
        """Renew a change from where its robot is now; raises RefusedError as `document`."""
        entry = document.navigation[0]
        place, _ = self._present(host, entry.robot)
        bare = entry.model_copy(update={"waypoints": entry.waypoints[1:]})
        return _from(document.model_copy(update={"navigation": [bare]}), place)

    def envelope_objection(
        self,
        host: ActiveMission,
        document: MissionDocument,
        verdict: VerdictOut,
        allowed: ApprovalOut,
    ) -> str:
        """Why a change needs a new approval; empty if it lies within the envelope of the first.

        Args:
            host: The mission in flight.
            document: Document of the change.
            verdict: Verdict of its rehearsal.
            allowed: Approval of the mission.
        """
        entry = document.navigation[0]
        if allowed.envelope is None:
            return "no changes were approved beforehand"
        if verdict.seconds is None:
            return "its rehearsal tells no duration"
        place, status = self._present(host, entry.robot)
        places = [place, *((one.x, one.y, one.z) for one in entry.waypoints[1:])]
        minutes = (seconds(status.mission.stamp) + verdict.seconds) / _MINUTE
        return envelope_violation(allowed.envelope, places, minutes)

    def apply(self, host: ActiveMission, document: MissionDocument) -> Answer:
        """Have a robot fly a change's waypoints in the place of its own.

        Args:
            host: The mission in flight.
            document: Document of the change.

        Returns:
            The robot's own answer.

        Raises:
            AeroDaaSError: If it takes no other waypoints now, or the flight does not answer.
        """
        entry = document.navigation[0]
        wanted = NavigationIn(robot=entry.robot, waypoints=entry.waypoints[1:], clear_first=True)
        self._present(host, entry.robot)
        # As its user: after the end of the lease, the flight obeys operators alone.
        return host.follow().fly(wanted, operator=False)

    def _present(self, host: ActiveMission, robot: str) -> tuple[Place, RobotStatus]:
        """Place and status of a robot that takes other waypoints; raises RefusedError otherwise."""
        if host.phase is not MissionPhase.FLYING:
            raise RefusedError(409, f"{host.row.id} is not flying: {host.phase.value}")
        if robot not in host.row.robots:
            raise RefusedError(422, f"{robot} does not fly in {host.row.id}")
        state = None if host.link is None else host.link.mission
        status = None if state is None else state.status.get(robot)
        if state is None or status is None or status.place is None:
            raise RefusedError(409, f"nobody knows where {robot} is: ask again in a moment")
        age = seconds(host_time_ns()) - state.told.get(robot, -math.inf)
        if age > _STALE_SECONDS:
            raise RefusedError(409, f"{robot} was heard {age:.0f} s ago: ask again in a moment")
        if status.mission.state not in _CHANGEABLE:
            raise RefusedError(
                409,
                f"{robot} is {status.mission.state.value}, and takes no other waypoints: it is "
                "changed on its way alone",
            )
        return status.place, status


def _local(waypoint: Waypoint, origin: GeodeticOrigin | None) -> Waypoint:
    """A waypoint in metres east, north and up of home; raises RefusedError for another one."""
    if waypoint.waypoint_type is WaypointType.RELATIVE or waypoint.above is not None:
        raise RefusedError(
            422,
            "a change's waypoints are metres east, north and up of home, with "
            '"waypoint_type": "local", or on the globe, without `above`',
        )
    try:
        return waypoint.resolve(np.zeros(3), origin)
    except InvalidWaypointError as error:
        raise RefusedError(422, str(error)) from None


def _from(document: MissionDocument, place: Place) -> MissionDocument:
    """A change's document that begins at a place."""
    entry = document.navigation[0]
    east, north, up = place
    name, taken = _PRESENT, {waypoint.id for waypoint in entry.waypoints}
    while name in taken:
        name += "'"
    first = Waypoint(name, east, north, up, waypoint_type=WaypointType.LOCAL)
    whole = entry.model_copy(update={"waypoints": [first, *entry.waypoints]})
    return document.model_copy(update={"navigation": [whole]})

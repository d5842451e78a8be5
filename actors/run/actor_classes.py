"""Classes of a run's actors: in real time, and in lockstep."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aerodaas.actors.analytics import AnalyticsActor
from aerodaas.actors.dispatch.dispatcher import DispatcherActor
from aerodaas.actors.drone.actor import DroneActor
from aerodaas.actors.lockstep.analytics import LockstepAnalyticsActor
from aerodaas.actors.lockstep.dispatcher import LockstepDispatcherActor
from aerodaas.actors.lockstep.drone import LockstepDroneActor
from aerodaas.actors.lockstep.recorder import LockstepRecorderActor
from aerodaas.actors.lockstep.sensor import LockstepSensorActor
from aerodaas.actors.lockstep.timed_dispatcher import TimedDispatcherActor
from aerodaas.actors.recorder import RecorderActor
from aerodaas.actors.sensor import SensorActor
from aerodaas.runtime.session import Session

__all__ = ["ActorClasses", "actor_classes"]


@dataclass(frozen=True)
class ActorClasses:
    """Class of each kind of actor."""

    drone: type[DroneActor]
    sensor: type[SensorActor]
    analytics: type[AnalyticsActor]
    dispatcher: type[DispatcherActor]
    recorder: type[RecorderActor]


_REAL_TIME = ActorClasses(DroneActor, SensorActor, AnalyticsActor, DispatcherActor, RecorderActor)
_LOCKSTEP = ActorClasses(
    LockstepDroneActor,
    LockstepSensorActor,
    LockstepAnalyticsActor,
    LockstepDispatcherActor,
    LockstepRecorderActor,
)


def actor_classes(session: Session) -> ActorClasses:
    """Return the classes of a run's actors."""
    if session.simulates_executions:
        return replace(_LOCKSTEP, dispatcher=TimedDispatcherActor)
    return _LOCKSTEP if session.lockstep else _REAL_TIME

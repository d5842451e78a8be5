"""Additions to a running flight for a graph that has grown in flight."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aerodaas.errors import GraphError
from aerodaas.runtime.nodes.controller import RobotSpec
from aerodaas.runtime.plan import ActorPlan, FlightPlan

__all__ = ["Growth", "growth"]


@dataclass(frozen=True)
class Growth:
    """Difference between two plans of one run."""

    actors: tuple[ActorPlan, ...]
    """Actors to be started, with cameras and analyses."""
    joining: tuple[ActorPlan, ...]
    """Cameras and analyses that join running actors of these names."""
    ending: dict[str, bool]
    """Running cameras whose last image now ends, or no longer ends, the mission, by stream."""
    drones: tuple[tuple[RobotSpec, ...], ...]
    """All robots of the new plan, by actor."""
    recorded: dict[str, int]
    """Further streams for the recorder, and their queue depths."""


def growth(old: FlightPlan, new: FlightPlan) -> Growth:
    """Compare the running plan with that of the current graph.

    Args:
        old: The running plan.
        new: The plan of the current graph.

    Raises:
        GraphError: If the analytics scheduler has an additional task, which is impossible in
            flight.
    """
    _require_same_tasks(old, new)
    running = {spec.stream for spec in (*old.cameras, *old.analyses)}
    known = {actor.name for actor in old.actors}
    ended = {camera.stream: camera.ends for camera in old.cameras}
    added = [
        replace(
            actor,
            cameras=tuple(spec for spec in actor.cameras if spec.stream not in running),
            analyses=tuple(spec for spec in actor.analyses if spec.stream not in running),
        )
        for actor in new.actors
    ]
    added = [actor for actor in added if actor.cameras or actor.analyses]
    return Growth(
        actors=tuple(actor for actor in added if actor.name not in known),
        joining=tuple(actor for actor in added if actor.name in known),
        ending={
            camera.stream: camera.ends
            for camera in new.cameras
            if camera.stream in ended and ended[camera.stream] != camera.ends
        },
        drones=new.drones,
        recorded={
            stream: depth for stream, depth in new.recorded.items() if stream not in old.recorded
        },
    )


def _require_same_tasks(old: FlightPlan, new: FlightPlan) -> None:
    before, after = (
        {one.stream for one in plan.dispatch.managed} if plan.dispatch is not None else set()
        for plan in (old, new)
    )
    if after - before:
        raise GraphError(
            f"{', '.join(sorted(after - before))} would be a task of the analytics scheduler, "
            "which knows all its tasks when the mission starts: call analyse() before "
            "start_mission(), and trigger() it if it is to sleep until it is needed"
        )

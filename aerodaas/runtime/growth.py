"""Additions to a running flight for a graph that has grown in flight."""

from __future__ import annotations

from dataclasses import dataclass, replace

from aerodaas.runtime.controller import RobotSpec
from aerodaas.runtime.plan import AnalyticsActorPlan, Cameras, FlightPlan
from aerodaas.types.errors import GraphError

__all__ = ["Growth", "growth"]


@dataclass(frozen=True)
class Growth:
    """Difference between two plans of one run."""

    cameras: tuple[Cameras, ...]
    """Cameras to be started."""
    ending: dict[str, bool]
    """Running cameras whose last image now ends, or no longer ends, the mission, by stream."""
    analyses: tuple[AnalyticsActorPlan, ...]
    """Analytics actors to be started."""
    joining: tuple[AnalyticsActorPlan, ...]
    """Analyses that join running actors of these names."""
    drones: tuple[tuple[RobotSpec, ...], ...]
    """All robots of the new plan, by actor."""
    recorded: dict[str, int]
    """Further streams for the recorder, and their queue depths."""


def growth(old: FlightPlan, new: FlightPlan) -> Growth:
    """Compare the running plan with that of the current graph.

    Raises GraphError for an additional task of the analytics scheduler, which is impossible in
    flight.
    """
    _require_same_tasks(old, new)
    running = {node.stream for actor in old.analyses for node in actor.nodes}
    known = {actor.name for actor in old.analyses}
    ended = {camera.stream: camera.ends for camera in old.cameras}
    added = [
        replace(actor, nodes=tuple(node for node in actor.nodes if node.stream not in running))
        for actor in new.analyses
    ]
    added = [actor for actor in added if actor.nodes]
    return Growth(
        cameras=tuple(one for one in new.cameras if one.stream not in ended),
        ending={
            one.stream: one.ends
            for one in new.cameras
            if one.stream in ended and ended[one.stream] != one.ends
        },
        analyses=tuple(actor for actor in added if actor.name not in known),
        joining=tuple(actor for actor in added if actor.name in known),
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

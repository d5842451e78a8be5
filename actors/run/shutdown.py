"""Shutdown of a run's actors: in groups, the recorder last, with a timeout for each."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Sequence
from typing import Any, cast

import ray
from ray.exceptions import GetTimeoutError, RayActorError, RayError

from aerodaas.errors import AeroDaaSError
from aerodaas.runtime.reports import ActorReport

__all__ = ["end_actors", "may_fly"]

_STOP_TIMEOUT = 20.0
_ANSWER_TIMEOUT = 5.0


def may_fly(drone: Any) -> bool:  # noqa: ANN401 - an actor's handle
    """Return whether the mission of a drone's actor is running, or its status is unknown."""
    try:
        report = cast("ActorReport", ray.get(drone.report.remote(), timeout=_ANSWER_TIMEOUT))
    except RayActorError:
        return False
    except GetTimeoutError:
        return True
    else:
        return report.phase == "running"


def end_actors(groups: Iterable[Sequence[Any]], helpers: Sequence[Any]) -> dict[Any, ActorReport]:
    """Stop each group of actors in turn, then end the processes of all.

    Args:
        groups: Actors that are stopped together.
        helpers: Actors that are ended without a stop.

    Returns:
        The final reports by handle, of the actors that answered.
    """
    reports: dict[Any, ActorReport] = {}
    killed = list(helpers)
    for group in groups:
        references = {actor.stop.remote(): actor for actor in group}
        killed += group
        if not references:
            continue
        done, _ = ray.wait(list(references), num_returns=len(references), timeout=_STOP_TIMEOUT)
        for reference in done:
            with contextlib.suppress(RayError, AeroDaaSError):
                reports[references[reference]] = ray.get(reference)
    for actor in killed:
        with contextlib.suppress(RayError):
            # A kill needs the cluster's head, which may be lost; `leave` does not.
            actor.exit.remote()
            ray.kill(actor)
    return reports

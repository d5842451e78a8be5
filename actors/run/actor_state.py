"""Members of a run: the application's record of each actor, and calls to it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import ray
from ray.exceptions import GetTimeoutError, RayActorError, RayTaskError

from aerodaas.actors.base import ActorInfo
from aerodaas.actors.run.losses import DeadError
from aerodaas.clock import NANOSECONDS, host_time_ns
from aerodaas.errors import AeroDaaSError, MissionError, SilentError
from aerodaas.runtime.reports import ActorReport

__all__ = ["ActorState", "ask", "require_clock", "routes"]

_ANSWER_TIMEOUT = 5.0
_CLOCKS_APART = 1.0
"""Seconds by which clocks may differ; they time missions and measure latencies."""


@dataclass
class ActorState:
    """State of one actor of the run."""

    name: str
    handle: Any
    setup: tuple[Any, ...]
    """Arguments of `prepare`."""
    restarts: int
    """Most restarts by Ray."""
    info: ActorInfo | None = None
    report: ActorReport = field(default_factory=lambda: ActorReport("new"))
    pending: ray.ObjectRef[ActorReport] | None = None
    answered_at: float = 0.0
    """Host's monotonic seconds of its last report."""
    silent: bool = False
    """Whether it was reported that it does not answer."""
    lost_at: float | None = None
    """Host's monotonic seconds at which its death was detected; None while it is alive."""


def ask(reference: Any, timeout: float = _ANSWER_TIMEOUT) -> Any:  # noqa: ANN401 - as it says
    """Wait for the result of an actor call.

    Args:
        reference: Ray's reference of the result.
        timeout: Seconds.

    Raises:
        DeadError: If the actor died.
        SilentError: If it does not answer in time.
        AeroDaaSError: What the call raises; MissionError for an error of another kind.
    """
    try:
        return ray.get(reference, timeout=timeout)
    except RayTaskError as error:
        cause = error.cause
        if isinstance(cause, AeroDaaSError):
            raise cause from None
        raise MissionError(f"{type(cause).__name__}: {cause}") from cause
    except RayActorError as error:
        # Ray puts the remote traceback first and the message last.
        reason = str(error).strip().splitlines()[-1]
        raise DeadError(f"an actor died: {reason}") from None
    except GetTimeoutError:
        raise SilentError(f"an actor did not answer within {timeout:.0f} s") from None


def routes(member: ActorState, members: Iterable[ActorState]) -> dict[str, list[Any]]:
    """Readers of each stream of `member` on other nodes, or without shared memory.

    Args:
        member: An actor that is prepared.
        members: All actors; those that are not prepared read nothing.
    """
    here = member.info
    assert here is not None  # noqa: S101 - prepared
    known = [(one.handle, one.info) for one in members if one.info is not None]
    found = {
        stream: [
            handle
            for handle, reader in known
            if stream in reader.reads and not _share_memory(here, reader)
        ]
        for stream in here.publishes
    }
    return {stream: readers for stream, readers in found.items() if readers}


def require_clock(name: str, info: ActorInfo, began: int) -> None:
    """Check that an actor's clock is between start and end of its `prepare`.

    A deviation of up to `_CLOCKS_APART` is tolerated.

    Args:
        name: Name of the actor.
        info: Its answer, with its clock at the end of `prepare`.
        began: This host's clock at the start, nanoseconds.

    Raises:
        MissionError: If the clock is ahead or behind.
    """
    ahead = max(info.clock - host_time_ns(), 0) - max(began - info.clock, 0)
    if abs(ahead) > _CLOCKS_APART * NANOSECONDS:
        side = "ahead of" if ahead > 0 else "behind"
        raise MissionError(
            f"the clock of the machine that runs {name} is {abs(ahead) / NANOSECONDS:.0f} s {side} "
            "this one's; set both by NTP (`timedatectl set-ntp true`) before flying"
        )


def _share_memory(one: ActorInfo, other: ActorInfo) -> bool:
    return one.node_id == other.node_id and one.shared_memory and other.shared_memory

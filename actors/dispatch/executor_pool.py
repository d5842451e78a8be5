"""Pool of the cloud's executors: selects an executor for a task and estimates its time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from aerodaas.actors.dispatch.frame_uplink import FrameUplink
from aerodaas.actors.dispatch.remote_executor import Executor, RemoteExecutor, RemoteResult
from aerodaas.messages.envelope import Message
from aerodaas.schedulers.analytics.base import Task

__all__ = ["ExecutorPool"]

_UNKNOWN = 0.3
"""Expected seconds on an executor that has not executed an analysis yet."""


_TOO_LATE = "its frame would have been there too late"


class ExecutorPool:
    """Executors in the cloud; a task goes to the one that is expected to answer first."""

    def __init__(
        self,
        executors: Sequence[Executor],
        timeout_ns: int,
        wake: Callable[[], None],
        speed: float = 1.0,
    ) -> None:
        """Use `executors`; `timeout_ns`, `wake` and `speed` as in `RemoteExecutor`."""
        # Processes of one node share its link, and frames are encoded once for all of them.
        frame_uplinks = {one.site: FrameUplink(one.codec) for one in executors}
        self._clouds = [
            RemoteExecutor(one, frame_uplinks[one.site], timeout_ns, wake, speed)
            for one in executors
        ]
        self._frame_uplinks = frame_uplinks
        self._slots = {one.site: one.slots for one in executors}
        self._homeless: deque[RemoteResult] = deque()

    @property
    def slots(self) -> int:
        """Most concurrent executions on the executors that are not gone."""
        present = {cloud.executor.site for cloud in self._clouds if not cloud.gone}
        return sum(self._slots[site] for site in present)

    def expected(self, model: str) -> float | None:
        """Expected seconds from sending a task to its result; None while unknown."""
        known = [cloud.expected(model) for cloud in self._able(model)]
        return min((seconds for seconds in known if seconds is not None), default=None)

    def on_the_way(self, model: str) -> float:
        """Seconds of transfer of a frame sent now, queueing included, without execution."""
        return min((cloud.frame_uplink.expected for cloud in self._able(model)), default=0.0)

    def send(self, task: Task, message: Message[Any], now: int, budget: float) -> None:
        """Start an execution; a frame that would arrive too late is not sent.

        Args:
            task: The task.
            message: The frame.
            now: Mission clock, nanoseconds.
            budget: Host seconds for which its result is useful.
        """
        model = task.profile.model
        able = self._able(model)
        if not able:
            self._homeless.append(RemoteResult(task, error="nothing in the cloud runs it"))
            return
        best = min(able, key=lambda cloud: self._delay(cloud, model))
        if best.frame_uplink.expected > budget:
            # It would delay the subsequent frames on the link.
            self._homeless.append(RemoteResult(task, timed_out=True, error=_TOO_LATE))
        else:
            best.send(task, message, now, budget)

    def answers(self, now: int) -> Iterator[RemoteResult]:
        """Yield the results of executions that returned, timed out, or could not be sent."""
        while self._homeless:
            yield self._homeless.popleft()
        for cloud in self._clouds:
            yield from cloud.answers(now)

    def probe(self, now: int) -> None:
        """Measure idle links, and probe executors that are gone."""
        for cloud in self._clouds:
            cloud.probe(now)

    def finish(self, timeout: float) -> None:
        """Wait up to `timeout` seconds for the current executions."""
        for cloud in self._clouds:
            cloud.finish(timeout)

    def values(self) -> dict[str, Any]:
        """Figures of each site: codec, milliseconds, Mbit/s, frames and megabytes sent."""
        return {
            site: {
                "latency_ms": frame_uplink.link.latency * 1e3,
                "bandwidth_mbit": frame_uplink.link.bandwidth * 8e-6,
                "codec": str(frame_uplink.codec),
                "frames": frame_uplink.frames,
                "sent_mb": frame_uplink.bytes / 1e6,
            }
            for site, frame_uplink in self._frame_uplinks.items()
        }

    def _able(self, model: str) -> list[RemoteExecutor]:
        return [c for c in self._clouds if model in c.executor.models and not c.gone]

    @staticmethod
    def _delay(cloud: RemoteExecutor, model: str) -> float:
        expected = cloud.expected(model)
        return (_UNKNOWN if expected is None else expected) * (1.0 + cloud.load)

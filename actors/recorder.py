"""Recorder's runner and actor: the recorder node, its pauses, and the run's orphan reaper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from aerodaas.actors.base import NodeActor
from aerodaas.actors.cluster.orphan_reaper import ReaperHost, Watched
from aerodaas.actors.node_runner import NodeRunner
from aerodaas.config.options import LiveViews
from aerodaas.messages.vitals import Vitals
from aerodaas.recording.provenance import Provenance
from aerodaas.runtime.node import Node
from aerodaas.runtime.nodes.recorder import RecorderNode
from aerodaas.runtime.session import Session

__all__ = ["BatchPause", "RecorderActor", "RecorderSpec"]

_LONGEST_PAUSE = 0.1
"""Wall seconds between two batches of messages."""
_WAIT = 0.2
"""Wall seconds of one wait for messages."""


_FIRST = 0.001
_GROWTH = 1.25
"""Factor by which the pause grows from batch to batch, while no queue fills."""
_ROOM = 4
"""A batch that has more of a stream than this part of its queue divides the pause by as much."""


class BatchPause:
    """Wall seconds until the next batch: as many as leave most of each queue free."""

    def __init__(self, longest: float) -> None:
        """Begin with a millisecond; `longest` is the longest pause in seconds, 0 for none."""
        self._longest = longest
        self._pause = _FIRST

    def after(self, counts: Mapping[str, int], depths: Mapping[str, int]) -> float:
        """The pause after a batch, seconds.

        Args:
            counts: Messages of the batch, by stream.
            depths: Depth of each stream's queue.
        """
        if any(count > depths[stream] // _ROOM for stream, count in counts.items()):
            self._pause /= _ROOM
        else:
            self._pause = min(self._longest, self._pause * _GROWTH)
        return self._pause


@dataclass(frozen=True)
class RecorderSpec:
    """Specification of the recorder for its actor."""

    path: Path
    streams: dict[str, int]
    """Queue depths by stream; further messages are dropped and counted, because the flight never
    waits."""
    provenance: Provenance
    views: LiveViews | None
    niceness: int = 10
    """Of its process."""

    def make(self, session: Session) -> RecorderNode:
        """Make the node."""
        return RecorderNode(session, self.path, self.streams, self.provenance, self.views)


class _RecorderRunner(NodeRunner):
    """Runner that lets messages gather, and records how many were dropped."""

    def __init__(self, actor: NodeActor, node: RecorderNode) -> None:
        super().__init__(actor, node)
        self._recorder = node
        self._lost: Counter[str] = Counter()
        # Who watches live sees each message as it comes.
        self._pause = BatchPause(0.0 if node.shows_live else _LONGEST_PAUSE)

    def run(self) -> None:
        """Record until the actor is stopped and every message is written."""
        try:
            while self.record() or not self._actor.stopping:
                pass
        except Exception as error:  # noqa: BLE001 - a library of a live view may raise any
            self._actor.fail(error)

    def finish(self) -> None:
        """Write what the others have told while they closed."""
        self.record(0.0)

    def record(self, wait: float = _WAIT) -> bool:
        """Write the messages that have arrived, and let others gather; False without any."""
        messages = self.subscriber.receive(wait)
        counts = Counter(message.stream for message in messages)
        messages.reverse()
        while messages:
            # Each message is released as soon as it is written: frames are large.
            self._recorder.write(messages.pop())
        # At once, because the run may be killed.
        for stream, dropped in self.subscriber.dropped.items():
            if dropped > self._lost[stream]:
                self._recorder.count_drops(stream, dropped - self._lost[stream])
                self._lost[stream] = dropped
        self._actor.rest(self._pause.after(counts, self.node.reads))
        return bool(counts)


class RecorderActor(ReaperHost, NodeActor):
    """Actor of the recorder; as the last one of the run to end, it hosts the orphan reaper."""

    def __init__(self, session: Session, name: str, watched: Watched) -> None:
        """Create the actor, whose reaper looks after the `watched`."""
        NodeActor.__init__(self, session, name)
        ReaperHost.__init__(self, watched)

    def _runner(self, node: Node) -> NodeRunner:
        return (
            _RecorderRunner(self, node) if isinstance(node, RecorderNode) else super()._runner(node)
        )

    def vitals(self, readings: Mapping[str, Vitals]) -> None:
        """Record the vitals of the run's processes, by `actor@machine`."""
        for runner in self.runners:
            if isinstance(runner.node, RecorderNode):
                runner.node.write_vitals(readings, self.clock.now())

"""Lockstep barrier: mission time waits until all readers have processed each measurement.

Each measurement is known by its source and stamp. An analysis answers every item with exactly
one message, empty if it has nothing to say, so the readers at the ends of all paths tell that
everything between has been done; `paths` counts those ends.
"""

from __future__ import annotations

from collections import Counter, defaultdict

from aerodaas.dataflow.graph import Graph

__all__ = ["Barrier", "paths", "widest"]


def paths(graph: Graph, stream: str, steering: set[str], *, recorded: bool) -> int:
    """How many acknowledgements one message of `stream` leads to.

    The recorder, the drones' actor if the stream is among the `steering` ones, and an analysis
    whose results have no reader each give one.
    """
    ends = int(recorded) + (stream in steering)
    for node in graph.downstream(stream):
        ends += max(1, paths(graph, node.id, steering, recorded=recorded))
    return ends


def widest(graph: Graph, stream: str) -> int:
    """How many messages at most one message of `stream` leads to on any one stream."""
    counts: Counter[str] = Counter()
    waiting = [stream]
    while waiting:
        current = waiting.pop()
        counts[current] += 1
        waiting.extend(node.id for node in graph.downstream(current))
    return max(counts.values())


class Barrier:
    """Counts the acknowledgements under way, by source."""

    def __init__(self, windows: dict[str, int]) -> None:
        """Let `windows[source]` measurements of each source be under way while time goes on."""
        self.windows = windows
        self._missing: dict[str, dict[int, int]] = defaultdict(dict)
        self._forgotten: dict[str, int] = {}
        """The newest stamp of each source that is not waited for any more."""

    def expect(self, source: str, stamp: int, acknowledgements: int) -> None:
        """A measurement is about to be worked through."""
        missing = self._missing[source]
        missing[stamp] = missing.get(stamp, 0) + acknowledgements
        if not missing[stamp]:
            del missing[stamp]

    def acknowledge(self, source: str, stamp: int) -> None:
        """Count one reader's acknowledgement; it may come before the measurement is expected.

        Sources without a window are not waited for.
        """
        if source in self.windows and stamp > self._forgotten.get(source, -1):
            self.expect(source, stamp, -1)

    def forget(self) -> None:
        """Stop waiting for anything that is under way: its reader is gone."""
        for source, missing in self._missing.items():
            self._forgotten[source] = max([self._forgotten.get(source, -1), *missing])
        self._missing.clear()

    def clear(self, *, drain: bool = False) -> bool:
        """Whether time may go on; with `drain`, whether nothing at all is under way."""
        return all(
            len(missing) <= (0 if drain else self.windows[source])
            for source, missing in self._missing.items()
        )

    def waiting_for(self) -> list[str]:
        """Sources of which more is under way than may be."""
        return sorted(
            source
            for source, missing in self._missing.items()
            if len(missing) > self.windows[source]
        )

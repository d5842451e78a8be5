"""Lockstep barrier: holds mission time until all actors have processed the measurements.

A measurement is identified by its source and timestamp. An analysis answers every item with
exactly one message, empty without a result, so acknowledgements of the readers at the ends of
all paths imply that all analyses between are done; `paths` counts those ends.
"""

from __future__ import annotations

from collections import Counter, defaultdict

from aerodaas.dataflow.graph import Graph

__all__ = ["Barrier", "paths", "widest"]


def paths(
    graph: Graph,
    stream: str,
    steering: set[str],
    *,
    recorded: bool,
    later: frozenset[str] = frozenset(),
) -> int:
    """Number of acknowledgements that one message of `stream` leads to.

    The recorder, the drones' actor if the stream is among the `steering` ones, and an analysis
    whose results have no reader each give one. The analyses `later` answer at a later mission
    time, and a dispatcher acknowledges for them once that it has the message.
    """
    readers = graph.downstream(stream)
    ends = int(recorded) + (stream in steering) + any(node.id in later for node in readers)
    for node in readers:
        if node.id not in later:
            further = paths(graph, node.id, steering, recorded=recorded, later=later)
            ends += max(1, further)
    return ends


def widest(graph: Graph, stream: str) -> int:
    """Most messages on any one stream that one message of `stream` leads to."""
    counts: Counter[str] = Counter()
    waiting = [stream]
    while waiting:
        current = waiting.pop()
        counts[current] += 1
        waiting.extend(node.id for node in graph.downstream(current))
    return max(counts.values())


class Barrier:
    """Counter of unprocessed measurements by source."""

    def __init__(self, windows: dict[str, int]) -> None:
        """Allow `windows[source]` unprocessed measurements of each source as time advances."""
        self.windows = windows
        self._missing: dict[str, dict[int, int]] = defaultdict(dict)
        self._forgotten: dict[str, int] = {}
        """Newest timestamp of each source that is no longer waited for."""

    def expect(self, source: str, stamp: int, acknowledgements: int) -> None:
        """Expect this number of acknowledgements, or so many more, of a measurement.

        Sources without a window, and measurements that are waited for no longer, are ignored.
        """
        if source not in self.windows or stamp <= self._forgotten.get(source, -1):
            return
        missing = self._missing[source]
        missing[stamp] = missing.get(stamp, 0) + acknowledgements
        if not missing[stamp]:
            del missing[stamp]

    def acknowledge(self, source: str, stamp: int) -> None:
        """Count one acknowledgement, which may precede the call of `expect`."""
        self.expect(source, stamp, -1)

    def forget(self) -> None:
        """Stop waiting for all current measurements, because a reader is gone."""
        for source, missing in self._missing.items():
            self._forgotten[source] = max([self._forgotten.get(source, -1), *missing])
        self._missing.clear()

    def clear(self, *, drain: bool = False) -> bool:
        """Return whether time may advance; with `drain`, whether all measurements are processed."""
        return all(
            len(missing) <= (0 if drain else self.windows[source])
            for source, missing in self._missing.items()
        )

    def waiting_for(self) -> list[str]:
        """Sources with more unprocessed measurements than their window."""
        return sorted(
            source
            for source, missing in self._missing.items()
            if len(missing) > self.windows[source]
        )

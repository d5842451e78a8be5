"""Turns of tenants: whose rehearsal begins next, where not all can be flown at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

__all__ = ["in_turn"]


def in_turn(
    waiting: Iterable[tuple[str, str]], running: Iterable[str], begun: Mapping[str, int]
) -> list[str]:
    """Put what waits into the order in which it begins.

    First comes a tenant with the fewest under way, counting those before it in this order; among
    equals the one whose last one began longest ago, then who has waited longest.

    Args:
        waiting: Id and tenant of each, in the order of submission.
        running: Tenant of each that is under way.
        begun: When each tenant's last one began, as a number that grows.

    Returns:
        The ids.
    """
    counts = Counter(running)
    keyed = []
    for number, (id_, tenant) in enumerate(waiting):
        keyed.append((counts[tenant], begun.get(tenant, 0), number, id_))
        counts[tenant] += 1
    return [id_ for *_, id_ in sorted(keyed)]

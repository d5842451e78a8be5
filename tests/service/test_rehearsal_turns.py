"""Turns of rehearsals: nobody waits for what others have sent in heaps."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.service.mission_service import rehearsal_order

TENANTS = st.lists(st.sampled_from("abcd"), max_size=20)


@given(TENANTS, st.lists(st.sampled_from("abcd"), max_size=4))
def test_each_begins_once_and_each_tenants_in_their_order(
    sent: list[str], running: list[str]
) -> None:
    """Whoever else waits."""
    waiting = [(f"m{number:02}", tenant) for number, tenant in enumerate(sent)]
    order = rehearsal_order(waiting, running, {})
    assert sorted(order) == [id_ for id_, _ in waiting]
    for tenant in "abcd":
        own = [id_ for id_, owner in waiting if owner == tenant]
        assert [id_ for id_ in order if id_ in own] == own


@given(TENANTS)
def test_a_first_one_waits_for_no_tenants_second(sent: list[str]) -> None:
    """One after the other on one core, where each tenant's last one is remembered."""
    owners = {f"m{number:02}": tenant for number, tenant in enumerate(sent)}
    begun: dict[str, int] = {}
    rounds: Counter[str] = Counter()
    waiting = list(owners.items())
    for moment in range(1, len(sent) + 1):
        first = rehearsal_order(waiting, [], begun)[0]
        tenant = owners[first]
        still = {owner for _, owner in waiting}
        assert rounds[tenant] <= min(rounds[owner] for owner in still)
        rounds[tenant] += 1
        begun[tenant] = moment
        waiting.remove((first, tenant))

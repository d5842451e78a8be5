"""A tenant uses what its quotas allow in a calendar month."""

from __future__ import annotations

import math
from datetime import datetime, timezone

import pytest

from aerodaas.protocol.schemas import MissionPhase
from aerodaas.service.access.quotas import Quotas
from aerodaas.service.errors import RefusedError
from aerodaas.service.store import Mission, Store, Tenant, Usage


def moment(year: int, month: int, day: int) -> float:
    """Seconds of Unix time at its beginning."""
    return datetime(year, month, day, tzinfo=timezone.utc).timestamp()


def fly(
    store: Store,
    started: float,
    minutes: float,
    *,
    cloud_calls: int = 0,
    recorded_bytes: int = 0,
) -> None:
    """Keep what a mission has used."""
    id_ = f"m{len(store.usage.all())}"
    store.missions.add(
        Mission(id_, "survey", "farm", "pilot", MissionPhase.LANDED, ("a",), started, "")
    )
    store.usage.add(
        Usage(
            id_,
            "farm",
            "pilot",
            started,
            flight_seconds=60 * minutes,
            cloud_calls=cloud_calls,
            recorded_bytes=recorded_bytes,
        )
    )


def test_what_was_flown_this_month_counts(store: Store) -> None:
    """From its first second on, with what is flown just now."""
    store.tenants.put(Tenant("farm", flight_minutes=100.0, cloud_calls=5))
    quotas = Quotas(store)
    fly(store, moment(2026, 3, 1) - 1, 90.0, cloud_calls=9)
    fly(store, moment(2026, 3, 1), 30.0, cloud_calls=6)
    march = quotas.left("farm", moment(2026, 4, 1) - 1, committed=20.0)
    assert (march.flight_minutes, march.cloud_calls) == (50.0, -1)
    assert march.storage_bytes == math.inf
    assert quotas.left("farm", moment(2026, 4, 1)).flight_minutes == 100.0
    assert quotas.check("farm", 50.0, moment(2026, 3, 31), committed=20.0) == march
    with pytest.raises(RefusedError, match=r"leaves 50\.0 flight minutes .* 50\.1 are") as refused:
        quotas.check("farm", 50.1, moment(2026, 3, 31), committed=20.0)
    assert refused.value.status == 403


@pytest.mark.parametrize(("used", "fits"), [(4, True), (5, False)])
def test_calls_of_the_cloud_that_are_used_up_refuse_what_may_need_them(
    store: Store,
    used: int,
    fits: bool,  # noqa: FBT001 - a parameter
) -> None:
    """And nothing else."""
    store.tenants.put(Tenant("farm", cloud_calls=5))
    quotas, now = Quotas(store), moment(2026, 3, 9)
    fly(store, moment(2026, 3, 1), 1.0, cloud_calls=used)
    quotas.check("farm", 1.0, now)
    if fits:
        quotas.check("farm", 1.0, now, cloud=True)
    else:
        with pytest.raises(RefusedError, match="cloud calls of farm are used up") as refused:
            quotas.check("farm", 1.0, now, cloud=True)
        assert refused.value.status == 403


def test_a_full_storage_takes_no_mission(store: Store) -> None:
    """Until a recording is deleted, of whatever month it is."""
    store.tenants.put(Tenant("farm", storage_bytes=1000))
    quotas = Quotas(store)
    fly(store, moment(2025, 1, 1), 1.0, recorded_bytes=1000)
    with pytest.raises(RefusedError, match="fetch some, and delete them here"):
        quotas.check("farm", 1.0, moment(2026, 3, 1))
    store.usage.put(
        Usage("m0", "farm", "pilot", moment(2025, 1, 1), recorded_bytes=1000, kept=False)
    )
    assert quotas.check("farm", 1.0, moment(2026, 3, 1)).storage_bytes == 1000


def test_a_tenant_without_quotas_has_no_end(store: Store) -> None:
    """So has one that is not known."""
    for tenant in ("farm", "unknown"):
        assert Quotas(store).check(tenant, 1e9, moment(2026, 3, 1)).cloud_calls == math.inf

"""Two tenants' flights on one edge at once: how the service shares it between them.

python benchmarks/shared_edge.py
python benchmarks/shared_edge.py --slots 1 --weight 3 --json shared_edge.json

flies a mission of each tenant in real time, whose analyses sleep as long as models take, and counts
the tasks that end in time.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer
from _report import Report
from _served import served

from aerodaas.environment.provider.client import ProviderClient
from aerodaas.protocol.schemas import AccountIn, AnalyticsOut, MissionIn, TenantChange, TokenIn

UNITS = {"in time": "per s", "late": "per s", "dropped": "per s"}
TENANTS = {"first": 0.0, "second": 20.0}
"""Metres east of home where each tenant's drone starts."""
_RATE = 10.0
_SETTLE_SECONDS = 5.0
_NAMES = ("seen", "heard")


def environment() -> dict[str, Any]:
    """A drone with a small camera for each tenant."""
    camera = {"id": "cam", "type": "camera", "rate": _RATE}
    camera["settings"] = {"width": 160, "height": 120}
    robots = [
        {"id": f"{tenant}s", "start": [east, 0, 0], "sensors": [camera]}
        for tenant, east in TENANTS.items()
    ]
    edge = [{"id": "edge", "kind": "edge"}]
    return {"name": "load", "robots": robots, "compute": edge, "simulation": {"world": "empty"}}


def document(tenant: str, milliseconds: float) -> dict[str, Any]:
    """To and fro for minutes, with two analyses of each picture under DEMS."""
    drone, east = f"{tenant}s", TENANTS[tenant]
    waypoints = [
        {"id": f"w{turn}", "x": east, "y": 20.0 * (turn % 2), "z": 2.0, "waypoint_type": "local"}
        for turn in range(1, 40)
    ]
    analyses = [
        {
            "id": f"{drone}/{name}",
            "analysis": "SyntheticAnalytics",
            "settings": {"name": name, "edge_ms": milliseconds, "cloud_ms": milliseconds},
            "reads": [f"{drone}/cam"],
            "compute": "edge",
        }
        for name in _NAMES
    ]
    return {
        "format": "aerodaas-mission",
        "version": 1,
        "sensors": [f"{drone}/cam"],
        "analyses": analyses,
        "analytics_scheduler": "dems",
        "navigation": [{"robot": drone, "waypoints": waypoints}],
    }


def main(
    slots: Annotated[int, typer.Option(min=0, help="Of the edge; 0: not shared.")] = 1,
    weight: Annotated[float, typer.Option(help="Of the first tenant; the second has 1.")] = 3.0,
    milliseconds: Annotated[float, typer.Option(help="That an analysis takes.")] = 60.0,
    seconds: Annotated[float, typer.Option(min=5, help="Of counting.")] = 30.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Write figures here.")] = None,
) -> None:
    """Count what each tenant gets done."""
    words = ["--edge-slots", str(slots)] if slots else []
    report = Report("shared edge", UNITS, packages=["aerodaas"])
    with served(environment(), *words) as (admin, _, _):
        weights = dict(zip(TENANTS, (weight, 1.0), strict=True))
        missions = {
            tenant: submitted(admin, tenant, weights[tenant], milliseconds) for tenant in TENANTS
        }
        while not all(admin.mission(one).analytics for one in missions.values()):
            time.sleep(0.5)
        time.sleep(_SETTLE_SECONDS)
        before, began = {name: sums(admin, one) for name, one in missions.items()}, time.monotonic()
        time.sleep(seconds)
        after, took = {name: sums(admin, one) for name, one in missions.items()}, time.monotonic()
        for tenant in TENANTS:
            found = {
                unit: (getattr(after[tenant], name) - getattr(before[tenant], name))
                / (took - began)
                for unit, name in zip(UNITS, ("in_time", "late", "dropped"), strict=True)
            }
            report.row(tenant, found)
        for one in missions.values():
            admin.cancel(one)
        while any(admin.mission(one).ended is None for one in missions.values()):
            time.sleep(0.5)
    asked = _RATE * len(_NAMES)
    report.note(f"each asks for {asked:g} tasks a second of {milliseconds:g} ms")
    report.note(f"{slots} at once, weights {weight:g}:1" if slots else "the edge is not shared")
    report.show()
    if json_file is not None:
        report.write(json_file)


def submitted(admin: ProviderClient, tenant: str, weight: float, milliseconds: float) -> str:
    """Submit the mission of a tenant of this weight; returns its id."""
    admin.add_account(AccountIn(name=f"{tenant}_pilot", tenant=tenant))
    admin.change_tenant(tenant, TenantChange(weight=weight))
    secret = admin.issue_token(TokenIn(account=f"{tenant}_pilot")).secret
    wanted = {"document": document(tenant, milliseconds), "minutes": 15}
    client = ProviderClient(admin.address.base, str(secret))
    return client.submit(MissionIn.model_validate(wanted)).id


def sums(admin: ProviderClient, mission: str) -> AnalyticsOut:
    """What a mission's scheduler has done so far."""
    found = admin.mission(mission).analytics
    if found is None:
        raise SystemExit(f"{mission} is over: {admin.mission(mission).reason}")
    return found


if __name__ == "__main__":
    typer.run(main)

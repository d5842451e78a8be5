"""Extras: what is not installed is told with its remedy, and costs only what needs it."""

from __future__ import annotations

import sys

import pytest

from aerodaas.analytics import RemoteAnalytics
from aerodaas.config.extras import has_extra, require_extra
from aerodaas.errors import ConfigError, SchedulerError
from aerodaas.schedulers.trajectory.routing import require_solver


@pytest.mark.parametrize(
    ("extra", "package"),
    [("notebook", "pandas"), ("plots", "matplotlib"), ("remote", "uvicorn"), ("ros", "rosbags")],
)
def test_a_missing_extra_is_named_with_its_remedy(
    extra: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One of its packages missing is enough."""
    assert has_extra(extra)
    require_extra(extra, "this")
    monkeypatch.setitem(sys.modules, package, None)
    assert not has_extra(extra)
    remedy = rf"this needs .*{package}.*: pip install 'aerodaas\[{extra}\]'"
    with pytest.raises(ConfigError, match=remedy):
        require_extra(extra, "this")


def test_what_needs_an_extra_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the application's own line."""
    monkeypatch.setitem(sys.modules, "fastapi", None)
    monkeypatch.setitem(sys.modules, "pyvrp", None)
    with pytest.raises(ConfigError, match="RemoteAnalytics needs fastapi"):
        RemoteAnalytics()
    with pytest.raises(SchedulerError, match=r"aerodaas\[routing\]"):
        require_solver("a route")

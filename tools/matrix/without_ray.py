"""A plugin of pytest that leaves out the tests which start Ray."""

from __future__ import annotations

import pytest

__all__ = ["pytest_collection_modifyitems"]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep what needs no running Ray."""
    left = [item for item in items if "runtime" in getattr(item, "fixturenames", ())]
    items[:] = [item for item in items if item not in left]
    config.hook.pytest_deselected(items=left)

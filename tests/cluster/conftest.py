"""One edge–cloud of namespaces for a module, and this process as an application on its edge."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

_HERE = Path(__file__).resolve().parent
_ROOT = _HERE.parents[1]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Namespaces and shaped links are root's to make."""
    skip = pytest.mark.skip(reason="network namespaces need root: run the tests by sudo")
    for item in items:
        if "edge_cloud" in getattr(item, "fixturenames", ()) and os.geteuid() != 0:
            item.add_marker(skip)


@pytest.fixture(scope="module")
def edge_cloud() -> Iterator[object]:
    """An edge and two cloud nodes, 40 ms and 50 Mbit/s away; Ray here is connected to them."""
    import ray  # noqa: PLC0415 - only where a cluster is wanted

    from aerodaas.actors import cluster  # noqa: PLC0415
    from aerodaas.cluster import EdgeCloud, Shape  # noqa: PLC0415

    before = ray.is_initialized()
    if before:
        cluster.disconnect()
    paths = (_ROOT, _HERE, _ROOT / "tests", _ROOT / "tests/actors")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join(map(str, paths)))
        with EdgeCloud(2, shape=Shape(0.04, 50e6)) as made:
            cluster.connect(made.address)
            try:
                yield made
            finally:
                cluster.disconnect()
    if before:
        cluster.connect(None)

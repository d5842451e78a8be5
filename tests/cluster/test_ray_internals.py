"""What is used of Ray's internals works with this Ray, and its loss costs a message at most."""

from __future__ import annotations

import importlib
import subprocess
import sys
import types
from collections.abc import Callable

import pytest
import ray

from aerodaas.actors.cluster import ray_internals

MODULES = (
    "ray._private.auto_init_hook",
    "ray._raylet",
    "ray._private.worker",
)


def gone(name: str) -> types.ModuleType | None:
    """The module does not exist any more."""
    del name
    return None


def emptied(name: str) -> types.ModuleType:
    """Its names are others."""
    return types.ModuleType(name)


def changed(name: str) -> types.ModuleType:
    """Its functions take other arguments."""
    module = types.ModuleType(name)
    vars(module)["GcsClient"] = lambda _other, _arguments: None
    return module


@pytest.mark.parametrize("become", [gone, emptied, changed])
def test_a_ray_that_has_changed_fails_nothing(
    become: Callable[[str], types.ModuleType | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Versions are unknown then, and the rest does nothing."""
    for name in MODULES:
        importlib.import_module(name)
        monkeypatch.setitem(sys.modules, name, become(name))
    assert ray_internals.cluster_metadata("127.0.0.1:1", 0.1) == {}
    ray_internals.forbid_start()
    ray_internals.reread_variables()
    ray_internals.silence_nodes()


@pytest.mark.usefixtures("runtime")
def test_the_head_tells_its_versions() -> None:
    """As this Ray's own."""
    found = ray_internals.cluster_metadata(ray.get_runtime_context().gcs_address, 5.0)
    assert found["ray_version"] == ray.__version__


@pytest.mark.usefixtures("runtime")
def test_nodes_are_silent(capfd: pytest.CaptureFixture[str]) -> None:
    """Where Ray would print what a node says."""
    worker = importlib.import_module("ray._private.worker")
    data = {"lines": ["a worker died"], "pid": "raylet", "is_err": False}
    worker.print_to_stdstream(data, ignore_prefix=False)
    assert capfd.readouterr() == ("", "")


def test_ray_does_not_start_by_itself() -> None:
    """A late call of an application that has left its cluster fails; Ray would start another."""
    late = (
        "import ray\n"
        "from aerodaas.actors.cluster.ray_internals import forbid_start\n"
        "forbid_start()\n"
        "try: ray.nodes()\n"
        "except Exception as error: print(type(error).__name__)\n"
        "print(ray.is_initialized())"
    )
    said = subprocess.run(
        [sys.executable, "-c", late], capture_output=True, text=True, check=True, timeout=60
    )
    assert said.stdout.split() == ["RaySystemError", "False"]

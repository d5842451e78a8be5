"""Shared by all tests: one Ray for the session, and flights in this process."""

from __future__ import annotations

import os
import re
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import databases
import hypothesis
import pytest
import required
from flying import Flyer

from aerodaas.config.options import RunOptions, current_options

if TYPE_CHECKING:
    from provider_stub import Stub

    from aerodaas.environment.provider.client import ProviderClient

_ROOT = Path(__file__).resolve().parents[1]

# A busy machine is no failure: how long an example takes is asserted nowhere. The gate tries fewer
# examples than `make test-all`, which names the second profile.
hypothesis.settings.register_profile("gate", deadline=None, max_examples=40)
hypothesis.settings.register_profile("full", deadline=None, max_examples=200)
hypothesis.settings.load_profile("gate")

_CI = bool(os.environ.get("CI"))


def pytest_configure(config: pytest.Config) -> None:
    """What is missing fails in continuous integration; databases are fixtures."""
    config.pluginmanager.register(required)
    config.pluginmanager.register(databases)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Import no file that names none of the markers which all tests asked for have.

    Half a minute of two cores, where few are asked for out of thousands.
    """
    wanted = str(config.option.markexpr)
    if collection_path.suffix != ".py" or not re.fullmatch(r"\w+( and \w+)*", wanted):
        return None
    text = collection_path.read_text()
    return True if any(name not in text for name in wanted.split(" and ")) else None


_LONGEST = ("tests/apps/", "tests/cluster/", "tests/service/")
"""Slow tests of minutes on one worker, which come first of all."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> object:  # noqa: ANN401
    """Share tests out by file, so that fixtures are made once."""
    from xdist.scheduler import LoadScopeScheduling  # noqa: PLC0415 - not every run has workers

    scheduler = LoadScopeScheduling(config, log)
    scheduler._split_scope = _worker_share  # as its own subclasses do
    return scheduler


def _worker_share(nodeid: str) -> str:
    """What goes to one worker together with this test: its file, or all of tests/cluster.

    Those make network namespaces with the same addresses.
    """
    file = nodeid.partition("::")[0]
    return "tests/cluster" if file.startswith("tests/cluster/") else file


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files without Ray come first, so that a mistake in a function is told within seconds.

    Where slow ones run, they come before, the longest first, so that no worker is left alone with
    one at the end.
    What goes by the wall clock and met a busy machine is run once more, in CI only.
    """
    files: dict[str, list[pytest.Item]] = {}
    for item in items:
        files.setdefault(item.nodeid.partition("::")[0], []).append(item)
        if _CI and item.get_closest_marker("wall_clock"):
            item.add_marker(pytest.mark.flaky(reruns=1))

    def turn(name: str) -> int:
        if any(item.get_closest_marker("slow") for item in files[name]):
            return 0 if name.startswith(_LONGEST) else 1
        ray = any("runtime" in getattr(item, "fixturenames", ()) for item in files[name])
        return 3 if ray else 2

    items[:] = [item for name in sorted(files, key=turn) for item in files[name]]


@pytest.fixture(autouse=True)
def state_folder(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where journals of what was changed on a vehicle are kept: in no user's own folder."""
    folder = tmp_path_factory.getbasetemp() / "state" / uuid.uuid4().hex
    monkeypatch.setenv("XDG_STATE_HOME", str(folder))
    return folder


@pytest.fixture(autouse=True)
def _no_options_left_over() -> Iterator[None]:
    """What a command line asked for holds for its own run, not for the tests that follow."""
    token = current_options.set(RunOptions())
    arguments, places = list(sys.argv), list(sys.path)
    yield
    current_options.reset(token)
    sys.argv[:], sys.path[:] = arguments, places


@pytest.fixture(scope="session")
def plugin_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A folder from which actors import, too, for plug-ins that tests write."""
    folder = tmp_path_factory.mktemp("plugins")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield folder


@pytest.fixture(scope="session")
def runtime(plugin_folder: Path) -> Iterator[None]:
    """Ray on this machine, as a run of an application starts it."""
    from aerodaas.actors.cluster import (  # noqa: PLC0415 - only where actors are tested
        ray_cluster as cluster,
    )

    # Actors import the project and the tests' own analyses from where this process does.
    ours = [path for path in sys.path if path and Path(path).resolve().is_relative_to(_ROOT)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PYTHONPATH", os.pathsep.join([*ours, str(plugin_folder)]))
        cluster.disconnect()  # from one that a refused application has begun without these paths
        cluster.connect(None)
        yield
        cluster.disconnect()


@pytest.fixture
def flyer(
    plugin_folder: Path,  # noqa: ARG001 - flights import from there
    tmp_path: Path,
    request: pytest.FixtureRequest,
) -> Flyer:
    """Flies applications, their files under `tmp_path`; on Ray those that go by the clock."""
    return Flyer(tmp_path, lambda: request.getfixturevalue("runtime"))


@pytest.fixture
def own_logins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No token of whoever runs the tests is read or written."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    for name in ("AERODAAS_TOKEN", "AERODAAS_PROVIDER", "AERODAAS_INSECURE"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture
def stub(own_logins: None) -> Iterator[Stub]:  # noqa: ARG001 - for its effect
    """A provider's service that answers as a test tells it, on a loopback port."""
    from provider_stub import Stub as Service  # noqa: PLC0415 - only for the tests of the client

    with Service() as service:
        yield service


@pytest.fixture
def client(stub: Stub) -> ProviderClient:
    """A client with the right token for that service."""
    from provider_stub import TOKEN  # noqa: PLC0415 - as above

    from aerodaas.environment.provider.client import ProviderClient as Client  # noqa: PLC0415

    return Client(stub.url, TOKEN)

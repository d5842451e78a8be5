"""Several applications on one drone: one owns its navigation, guests share its sensors and compute.

A guest is an application like any other, whose author need not know of the owner. It
is run up to its `start_mission()`, which returns at once; its dataflow then joins the owner's, and
both fly as one run: one camera, one analytics scheduler for the compute, one recording.
"""

from __future__ import annotations

import runpy
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from aerodaas.analytics.commanding import CommandingAnalytics
from aerodaas.config.options import current_options
from aerodaas.dataflow.graph import Node, Trigger
from aerodaas.types.errors import ConfigError, GraphError, UnknownIdError
from aerodaas.types.identifiers import safe_name

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment

__all__ = ["offer", "welcome"]

_offered: ContextVar[list[Environment] | None] = ContextVar("offered", default=None)
"""Receiver of the environment of the guest under construction; None without one."""


def offer(environment: Environment) -> bool:
    """Receive the environment of a ready guest; False without a guest under construction."""
    offered = _offered.get()
    if offered is None:
        return False
    offered.append(environment)
    return True


def welcome(application: Path, host: Environment) -> None:
    """Run a guest's file up to its start and let its dataflow join the `host`'s.

    Raises ConfigError if there is no such file or it never starts, UnknownIdError for a robot,
    sensor or compute resource that the host's environment lacks, GraphError if it would navigate,
    and the guest's own exceptions.
    """
    if not application.is_file():
        raise ConfigError(f"there is no application {application} to be a guest")
    with _building(application) as offered:
        runpy.run_path(str(application), run_name="__main__")
    if not offered:
        raise ConfigError(f"{application.name} never called start_mission(), so it cannot join")
    for guest in offered:
        _refuse_navigation(guest, application.name)
        _join(guest, host, safe_name(application.stem))


@contextmanager
def _building(application: Path) -> Iterator[list[Environment]]:
    offered: list[Environment] = []
    # The owner's overrides are for the owner's environment file.
    options = replace(
        current_options.get(), application=application, environment=None, overrides={}, guests=()
    )
    tokens = current_options.set(options), _offered.set(offered)
    words, path = sys.argv, sys.path[:]
    sys.argv = [str(application)]
    sys.path.insert(0, str(application.resolve().parent))
    try:
        yield offered
    finally:
        sys.argv, sys.path[:] = words, path
        current_options.reset(tokens[0])
        _offered.reset(tokens[1])


def _refuse_navigation(guest: Environment, name: str) -> None:
    graph = guest.graph
    culprits = [edge.robot for edge in graph.navigation]
    culprits += [f"add_navigation(…) at {entry.line}" for entry in guest.navigation_waiting()]
    for node in graph.nodes.values():
        if isinstance(node.work, CommandingAnalytics):
            culprits.append(node.id)
        culprits += [f"{node.id} ({one.method})" for one in node.triggers if one.method is not None]
    if culprits:
        raise GraphError(
            f"{name} is a guest and may not command the drone, which its owner navigates; "
            f"leave out: {', '.join(dict.fromkeys(culprits))}"
        )


def _join(guest: Environment, host: Environment, prefix: str) -> None:
    graph, known = host.graph, [one.id for one in host.compute()]
    names: dict[str, str] = {}
    for node in guest.graph.nodes.values():
        if node.kind == "sensor":
            names[node.id] = _sensor(node, host)
            continue
        if node.compute is not None and node.compute not in known:
            raise UnknownIdError("compute resource", node.compute, known)
        robot, slash, own = node.id.rpartition("/")
        old, node.id = node.id, f"{robot}{slash}{prefix}_{own}"
        names[old] = graph.add(node).id
    for node in guest.graph.nodes.values():
        if node.kind != "sensor":
            node.inputs = [names[one] for one in node.inputs]
            node.triggers = [Trigger(names[one.target], when=one.when) for one in node.triggers]
    reader = guest.graph

    def connect() -> None:
        opened = graph.reader
        assert opened is not None  # noqa: S101 - set before the hooks are called
        reader.reader = lambda stream: opened(names[stream])

    graph.on_launch += [connect, *guest.graph.on_launch]


def _sensor(node: Node, host: Environment) -> str:
    """The owner's sensor of the same ids; raises UnknownIdError."""
    _, _, sensor = node.id.rpartition("/")
    if node.robot is None:
        known = [one.id for one in host.config.sensors]
        if sensor not in known:
            raise UnknownIdError("environment sensor", sensor, known)
        return host.get_env_sensor_by_id(sensor).get_data_stream().name
    return host.get_robot_by_id(node.robot).get_sensor_by_id(sensor).get_data_stream().name

"""Guests of a run: applications of others that share the owner's drone by what they are granted.

A guest's file runs in a process of its own, against a catalogue of what it is granted. From there
comes a document, which is checked here against the grants and joins the owner's graph as stand-ins
(`GuestAnalysis`); its code never enters a process of the owner. A guest that is refused, fails or
hangs is left out, and told by name.
"""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from aerodaas.analytics.guests.analysis import GuestAnalysis
from aerodaas.analytics.guests.answers import AnsweredCondition
from aerodaas.analytics.guests.channel import GuestError
from aerodaas.analytics.guests.document import (
    GuestDocument,
    GuestNavigation,
    GuestNode,
    read_document,
)
from aerodaas.analytics.guests.payload import require_no_moves
from aerodaas.analytics.guests.process import GuestProcess
from aerodaas.analytics.item_json import decoded
from aerodaas.config.checked import near
from aerodaas.config.grants import Catalogue, GuestGrants, parse_grants, reduced
from aerodaas.config.options import RunOptions
from aerodaas.dataflow.graph import AeroStreamData, NavigationEdge, Node, Trigger
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import AeroDaaSError, ConfigError, GraphError
from aerodaas.identifiers import safe_name
from aerodaas.messages.frames import Frame
from aerodaas.messages.waypoints import NavigationType, SchedulingType

if TYPE_CHECKING:
    from aerodaas.environment.environment import Environment

__all__ = ["GuestNote", "admit_guests"]

_BUILD_SECONDS = 60.0
_BUILD_CPU = 60
_UNCONFINED = (
    "this machine grants no namespaces, so the guest {name} can use the network, read this user's "
    "files and end this user's processes: strangers' code needs a user of its own "
    "(docs/security.md)"
)
_REASON = 1000
"""Most characters of a refusal, which may hold a guest's words."""


class GuestNote(NamedTuple):
    """What the owner is told of a guest: the kind of the alert, and its text."""

    kind: str
    text: str


def admit_guests(options: RunOptions, host: Environment) -> list[GuestNote]:
    """Let each guest's dataflow join the `host`'s; returns what the owner is to be told of them.

    That is the reason of each guest that is left out (`guest_refused`), and which ones this machine
    could not confine (`guest_unconfined`). Raises ConfigError for what the owner has wrong: a
    missing file, an unknown guest or right.
    """
    names = _names(options.guests)
    for wanted in options.grants:
        if wanted not in names:
            raise ConfigError(f"--grant {wanted}=…: there is no such guest{near(wanted, names)}")
    rights = {name: parse_grants(options.grants.get(name, ()), host.config, name) for name in names}
    return [note for name, path in names.items() for note in _admit(name, path, host, rights[name])]


def _admit(name: str, path: Path, host: Environment, grants: GuestGrants) -> Iterator[GuestNote]:
    """Let one guest join; yields what is to be told of it."""
    try:
        process = GuestProcess(name, grants.quota.memory, _BUILD_CPU, path.parent)
        if not process.isolated:
            yield GuestNote("guest_unconfined", _UNCONFINED.format(name=name))
        document, program = _build(process, path, host, grants)
        _Admission(name, host, grants, document, program).join()
    except AeroDaaSError as error:
        text = f"the guest {name} does not take part: {error}"[:_REASON]
        yield GuestNote("guest_refused", text)


def _names(guests: Sequence[Path]) -> dict[str, Path]:
    names: dict[str, Path] = {}
    for path in guests:
        name = safe_name(path.stem)
        if not path.is_file():
            raise ConfigError(f"there is no application {path} to be a guest")
        if name in names:
            raise ConfigError(f"two guests are called {name}; rename one's file")
        names[name] = path
    return names


def _build(
    process: GuestProcess, path: Path, host: Environment, grants: GuestGrants
) -> tuple[GuestDocument, bytes]:
    """Run the guest's file in its process and end that; raises GuestError or GraphError."""
    catalogue = Catalogue(process.guest, reduced(host.config, grants), grants)
    try:
        request = {"do": "build", "application": str(path)}
        answer, program = process.ask(request, pickle.dumps(catalogue), _BUILD_SECONDS)
    finally:
        process.end()
    if "refused" in answer:
        raise GuestError(str(answer["refused"]))
    return read_document(answer.get("document")), program


class _Admission:
    """One guest's document on its way into the host's graph."""

    def __init__(
        self,
        guest: str,
        host: Environment,
        grants: GuestGrants,
        document: GuestDocument,
        program: bytes,
    ) -> None:
        self._guest = guest
        self._host = host
        self._grants = grants
        self._document = document
        self._program = program
        self._own = {node.id: node for node in document.nodes}
        self._names: dict[str, str] = {}
        """Ids in the host's graph by those in the guest's."""

    def join(self) -> None:
        """Check everything, then add it; raises GraphError with the host's graph unchanged."""
        quota = self._grants.quota
        nodes = self._document.nodes
        if len(nodes) != len(self._own):
            raise GraphError("two of its analyses have one id")
        if len(nodes) > quota.analyses:
            raise GraphError(
                f"it has {len(nodes)} analyses, and may have {quota.analyses} "
                f"(--grant {self._guest}=analyses:{len(nodes)} allows more)"
            )
        for node in nodes:
            self._check(node)
        self._require_order()
        edges = [self._edge(one) for one in self._document.navigation]
        for node in nodes:
            self._add(node)
        for node in nodes:
            added = self._host.graph.nodes[self._names[node.id]]
            added.inputs = [self._names[one] for one in node.inputs]
            added.triggers = [
                Trigger(
                    self._names[one.target] if one.method is None else one.target,
                    one.method,
                    AnsweredCondition(self._guest, node.id, number),
                )
                for number, one in enumerate(node.triggers)
            ]
        self._host.graph.navigation += [self._named(one) for one in edges]

    def _check(self, node: GuestNode) -> None:
        quota = self._grants.quota
        robots = {robot.id for robot in self._host.config.robots}
        for one in node.inputs:
            if one not in self._own:
                self._require("sense", one, f"{node.id} reads {one}")
                self._names[one] = one
        if node.robot is not None and node.robot not in robots:
            raise GraphError(f"{node.id} belongs to {node.robot}, which is no robot")
        if node.compute is None:
            raise GraphError(f"{node.id}: deploy it on a granted compute resource")
        self._require("compute", node.compute, f"{node.id} runs on {node.compute}")
        if node.external and node.rate > quota.rate:
            raise GraphError(f"{node.id} has {node.rate:g} Hz, and may have {quota.rate}")
        if node.external == bool(node.inputs):
            raise GraphError(f"{node.id} needs either inputs or a rate of its own")
        for trigger in node.triggers:
            if trigger.method is not None:
                what = f"{node.id} triggers {trigger.target}.{trigger.method}"
                self._require("fly", trigger.target, what)
            elif trigger.target not in self._own:
                raise GraphError(f"{node.id} wakes {trigger.target}, which is not its own")

    def _require(self, right: str, name: str, what: str) -> None:
        if name not in getattr(self._grants, right):
            raise GraphError(
                f"{what}, which its owner has not granted "
                f"(--grant {self._guest}={right}:{name} would)"
            )

    def _require_order(self) -> None:
        """Raise GraphError for a cycle: an analysis reads those that come before it."""
        seen: set[str] = set()
        waiting = dict(self._own)
        while waiting:
            ready = [
                name
                for name, node in waiting.items()
                if all(one in seen or one not in self._own for one in node.inputs)
            ]
            if not ready:
                raise GraphError(f"its analyses {', '.join(waiting)} read each other in a circle")
            seen.update(ready)
            for name in ready:
                del waiting[name]

    def _edge(self, one: GuestNavigation) -> GuestNavigation:
        self._require("fly", one.robot, f"it navigates {one.robot}")
        for stream in (one.stream, one.clear_on):
            if stream is not None and stream not in self._own:
                raise GraphError(f"{one.robot} would fly by {stream}, which is not its own")
        if one.stream is not None and not self._own[one.stream].navigation:
            raise GraphError(f"{one.robot} cannot navigate by {one.stream}")
        require_no_moves(_waypoints(one), self._guest)
        return one

    def _add(self, node: GuestNode) -> None:
        host, sensors = self._host, {s.full_id: s for s in self._host.config.all_sensors()}
        for name in node.inputs:
            if name in sensors:
                host.sensor(sensors[name]).get_data_stream()
        seen = {sensors[one].robot for one in self._grants.sense}
        first = node.id == self._document.nodes[0].id
        work = GuestAnalysis(
            self._guest,
            node.id,
            self._grants.quota,
            navigates=node.navigation,
            sees_vehicle=node.robot is not None and node.robot in seen,
            program=self._program if first else b"",
        )
        inputs = [host.graph.nodes[one].item for one in node.inputs if one in sensors]
        frames = len(inputs) == len(node.inputs) and all(one is Frame for one in inputs)
        work.scheduled = node.scheduled and frames
        work.rate = node.rate
        robot, slash, own = node.id.rpartition("/")
        added = host.graph.add(
            Node(
                id=f"{robot}{slash}{self._guest}_{own}",
                kind="external" if node.external else "analytics",
                item=AeroNavigation if node.navigation else object,
                work=work,
                robot=node.robot,
                compute=node.compute,
                dormant=node.dormant,
            )
        )
        self._names[node.id] = added.id

    def _named(self, one: GuestNavigation) -> NavigationEdge:
        clear_on = self._names[one.clear_on] if one.clear_on is not None else None
        navigation = _waypoints(one)
        if one.stream is not None:
            name = self._names[one.stream]
            stream: AeroStreamData[AeroNavigation] = AeroStreamData(
                self._host.graph, name, AeroNavigation
            )
            navigation = AeroNavigation(
                NavigationType.ANALYTICS_DRIVEN,
                stream,
                navigation.scheduling_type,
                priority=one.priority,
            )
        return NavigationEdge(one.robot, navigation, one.index, one.deadline, clear_on)


def _waypoints(one: GuestNavigation) -> AeroNavigation:
    """The waypoints of a document; raises the project's errors for malformed ones."""
    kind = SchedulingType.ORDERED if one.ordered else SchedulingType.UNORDERED
    items = [decoded(item) for item in one.waypoints]
    return AeroNavigation(NavigationType.DISTANCE_DRIVEN, items, kind, priority=one.priority)

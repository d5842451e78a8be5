"""The mission document: an application's graph as data, which is checked and flown without code.

It is JSON of a fixed format. It names analyses and schedulers that are registered where it is
flown, and never a module, a package or an address. What is code of the application's own stays at
its user's side: the document holds a place for it, by what it reads and what it produces.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    model_validator,
)
from typing_extensions import Self

from aerodaas.config.checked import checked
from aerodaas.dataflow.graph import AeroStreamData
from aerodaas.dataflow.navigation import AeroNavigation
from aerodaas.errors import ConfigError
from aerodaas.identifiers import ScopedWord, Word
from aerodaas.messages.detections import Detections
from aerodaas.messages.odometry import Battery, GpsFix, Odometry
from aerodaas.messages.readings import Readings
from aerodaas.messages.waypoints import LARGEST, NavigationType, SchedulingType, Waypoint
from aerodaas.text.json_text import check_plain, read_json

__all__ = [
    "HERE_CONDITION",
    "HERE_ITEMS",
    "AnalysisEntry",
    "DocumentWaypoint",
    "HereEntry",
    "HereItem",
    "MissionDocument",
    "NavigationDocument",
    "SchedulerEntry",
    "TriggerEntry",
    "read_mission",
]

_MOST = 64
"""Most analyses, and most triggers, inputs or settings of one."""
_MOST_WAYPOINTS = 10_000
"""Of a document."""
_MOST_VALUES = 10_000
"""Of the settings of one analysis or scheduler, or of a condition."""
_MOST_ACTIONS = 24
"""Of a waypoint."""
_LONGEST = 64
"""Characters of a name."""
_MOST_HERTZ = 1000.0
HERE_CONDITION = "$here"
"""Key of a condition that is code at the user's side; its value is the trigger's number."""
HereItem: TypeAlias = Literal[
    "AeroNavigation",
    "Battery",
    "Detections",
    "GpsFix",
    "None",
    "Odometry",
    "Readings",
    "bool",
    "float",
    "int",
    "object",
    "str",
]
HERE_ITEMS: dict[HereItem, type] = {
    "AeroNavigation": AeroNavigation,
    "Battery": Battery,
    "Detections": Detections,
    "GpsFix": GpsFix,
    "None": type(None),
    "Odometry": Odometry,
    "Readings": Readings,
    "bool": bool,
    "float": float,
    "int": int,
    "object": object,
    "str": str,
}
"""What an analysis at the user's side may produce, by name; `object` is anything but pictures, and
a class of the application's own is known at the user's side alone."""


def _plain(value: object) -> object:
    """Refuse what no file can hold, which a request's JSON may; raises ValueError."""
    try:
        check_plain(value, "its value", _MOST_VALUES)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    return value


_Settings = Annotated[dict[str, Any], Field(max_length=_MOST), AfterValidator(_plain)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


def _of_a_document(waypoint: Waypoint) -> Waypoint:
    """A waypoint whose names are short enough for a document; raises ValueError for another."""
    if len(waypoint.actions) > _MOST_ACTIONS:
        raise ValueError(f"waypoint {waypoint.id[:_LONGEST]!r} does more than {_MOST_ACTIONS}")
    for name in (waypoint.id, *itertools.chain(*(one.names for one in waypoint.actions))):
        if not 0 < len(name) <= _LONGEST:
            raise ValueError(f"{name[:_LONGEST]!r}: a name has 1 to {_LONGEST} characters")
    return waypoint


DocumentWaypoint: TypeAlias = Annotated[Waypoint, AfterValidator(_of_a_document)]
"""A waypoint as it goes to a provider and into documents."""


class SchedulerEntry(_Entry):
    """A registered scheduler and its settings."""

    name: Word
    """Registered name, such as `nearest_neighbor`."""
    settings: _Settings = Field(default_factory=dict)
    """Arguments of its constructor, by name."""


class TriggerEntry(_Entry):
    """Trigger of an analysis: a condition on its results, and the target that it commands."""

    target: ScopedWord
    """Id of the analysis that is woken, or of the robot that is commanded."""
    command: Literal["end_mission", "pause_mission", "resume_mission"] | None = None
    """The robot's method; None for an analysis."""
    when: Annotated[Any, AfterValidator(_plain)] = None
    """The condition, as a value of the document; None for every result."""

    @property
    def at_users_side(self) -> bool:
        """Whether the condition is code that is evaluated at the user's side."""
        return isinstance(self.when, dict) and HERE_CONDITION in self.when


class HereEntry(_Entry):
    """The place of an analysis that is code at the user's side."""

    produces: HereItem
    """Type of its results, a key of `HERE_ITEMS`."""


class AnalysisEntry(_Entry):
    """One analysis: by its registered name, or at the user's side."""

    id: ScopedWord
    """Name of its stream: `robot/name`, with the robot of what it reads first; the name alone for
    one that reads no robot's stream."""
    analysis: Word | None = None
    """Registered name, such as `PersonFollowAnalytics`."""
    here: HereEntry | None = None
    """For one at the user's side, which has neither `analysis` nor settings, compute or task."""
    settings: _Settings = Field(default_factory=dict)
    """Arguments of its constructor, by name."""
    reads: list[ScopedWord] = Field(default_factory=list, max_length=_MOST)
    """Sensors by full id, and analyses; empty for a source of its own."""
    compute: ScopedWord | None = None
    """Id of the compute resource that runs it; None for the edge beside the drone."""
    rate: Annotated[float, Field(gt=0, le=_MOST_HERTZ)] | None = None
    """Hz of a source of its own, where the application set it."""
    task: _Settings | None = None
    """Benefit and costs for the analytics scheduler, where the application set them."""
    triggers: list[TriggerEntry] = Field(default_factory=list, max_length=_MOST)
    """What its results wake or command."""

    @model_validator(mode="after")
    def _is_one_kind(self) -> Self:
        if (self.analysis is None) == (self.here is None):
            raise ValueError(f"{self.id} has either `analysis`, a registered name, or `here`")
        if self.here is not None and (self.settings or self.compute or self.task):
            raise ValueError(f"{self.id} is at the user's side: no settings, compute or task")
        for number, one in enumerate(self.triggers):
            if one.at_users_side and one.when != {HERE_CONDITION: number}:
                raise ValueError(
                    f"{self.id}: the condition of trigger {number} at the user's side is "
                    f'{{"{HERE_CONDITION}": {number}}}'
                )
        return self


class NavigationDocument(_Entry):
    """Navigation of a robot: waypoints, or the stream of an analysis."""

    robot: Word
    """Id of the robot."""
    stream: ScopedWord | None = None
    """Id of the analysis that navigates it; None to fly by `waypoints`."""
    waypoints: Annotated[list[DocumentWaypoint], FailFast()] = Field(
        default_factory=list, max_length=_MOST_WAYPOINTS
    )
    """Places to fly to, each with an id of its own."""
    ordered: bool = True
    """Whether they are flown in the order given; otherwise the trajectory scheduler orders them."""
    priority: Annotated[int, Field(ge=0, le=LARGEST)] | None = None
    """Priority of all of it, smaller is more urgent; None: 5, or that of each waypoint."""
    index: Annotated[int, Field(ge=0, le=_MOST_WAYPOINTS)] | None = None
    """Number of waypoints of the same priority that it follows; None for the end."""
    deadline: Annotated[float, Field(gt=0, le=LARGEST)] | None = None
    """Seconds of mission time by which all of it is to be reached; None for no deadline."""
    clear_on: ScopedWord | None = None
    """Stream whose first item empties the queue."""

    def navigation(self, source: AeroStreamData[Any] | None = None) -> AeroNavigation:
        """The navigation itself: by `source`, the stream that it names, or by its waypoints."""
        ordering = SchedulingType.ORDERED if self.ordered else SchedulingType.UNORDERED
        kind = NavigationType.DISTANCE_DRIVEN if source is None else NavigationType.ANALYTICS_DRIVEN
        items = list(self.waypoints) if source is None else source
        return AeroNavigation(kind, items, ordering, priority=self.priority)


class MissionDocument(_Entry):
    """One application's graph."""

    format: Literal["aerodaas-mission"]
    """Always `aerodaas-mission`."""
    version: Literal[1]
    """Of the format, always 1."""
    name: str = Field("", max_length=100)
    """Of the application."""
    environment: str = Field("", max_length=200)
    """File name of the environment that it was written for; a hint."""
    sensors: list[ScopedWord] = Field(default_factory=list, max_length=_MOST)
    """Sensors that run, by full id."""
    analyses: Annotated[list[AnalysisEntry], FailFast()] = Field(
        default_factory=list, max_length=_MOST
    )
    """Each after those that it reads."""
    navigation: Annotated[list[NavigationDocument], FailFast()] = Field(
        default_factory=list, max_length=_MOST
    )
    """Empty for one that senses only, which a provider attaches to another flight's cameras."""
    trajectory_scheduler: SchedulerEntry | None = None
    """Orders waypoints; None for the environment's own."""
    analytics_scheduler: Word | None = None
    """Registered name of the scheduler that shares analyses out over edge and cloud; None for the
    environment's own."""

    @model_validator(mode="after")
    def _is_bounded(self) -> Self:
        if sum(len(one.waypoints) for one in self.navigation) > _MOST_WAYPOINTS:
            raise ValueError(f"a document has at most {_MOST_WAYPOINTS} waypoints")
        return self

    @property
    def here(self) -> list[str]:
        """Ids of the analyses that need the user's side, for themselves or for a condition."""
        return [
            one.id
            for one in self.analyses
            if one.here is not None or any(trigger.at_users_side for trigger in one.triggers)
        ]

    def text(self) -> str:
        """The file's content: JSON, a setting a line, so that two of them can be compared."""
        return self.model_dump_json(indent=2, exclude_defaults=True) + "\n"


def read_mission(path: str | Path) -> MissionDocument:
    """Read a mission document; raises ConfigError that names the file, the place and the remedy."""
    return checked(MissionDocument, read_json(path, "the mission document"), str(path))

"""The analysis node: items, wake commands, errors, external sources, answers and requests."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import pytest
from hosts import Hand, published

from aerodaas import Analytics, Frame
from aerodaas.analytics.base import Context
from aerodaas.clock import NANOSECONDS, SimulatedClock
from aerodaas.config.model import EnvironmentConfig
from aerodaas.messages.envelope import Message
from aerodaas.messages.frames import Header
from aerodaas.messages.odometry import Battery, Odometry
from aerodaas.messages.readings import Alert
from aerodaas.messages.vehicle import VehicleMode, VehicleState
from aerodaas.runtime.dispatch.recent_frames import FrameReference, MissingFrame
from aerodaas.runtime.node import NEVER
from aerodaas.runtime.nodes.analysis import AnalysisNode, AnalysisSpec, Wake
from aerodaas.runtime.nodes.triggers import TriggerSpec
from aerodaas.runtime.session import Session

_NODE, _INPUT, _STATE, _WAKE = "drone/double", "drone/number", "drone/@state", "drone/@wake"
_SESSION = Session(EnvironmentConfig.model_validate({"robots": [{"id": "drone"}]}), None)


class Double(Analytics[float]):
    """Doubles numbers; raises for negative ones, and finds nothing in zero."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.vehicles: list[VehicleState | None] = []

    def open(self) -> None:
        """Note the call."""
        self.calls.append("open")

    def process(self, item: float, context: Context) -> float | None:
        """Return twice the number."""
        self.calls.append(f"process {item} at {context.now()} on the {context.kind}")
        self.vehicles.append(context.vehicle())
        if item < 0:
            raise ValueError(f"negative: {item}")
        return 2 * item or None

    def close(self) -> None:
        """Note the call."""
        self.calls.append("close")


class Count(Analytics[int]):
    """An external source: counts its calls, and has nothing at the second."""

    rate = 4.0
    calls = 0

    def process(self, item: None, context: Context) -> int | None:
        """Count on."""
        assert item is None
        self.calls += 1
        if self.calls == 3:
            header = Header(0, context.now(), "count")
            context.alert(Alert(header, "third", "three calls", {"calls": 3}))
        return None if self.calls == 2 else self.calls


def spec_of(work: Analytics[Any], **changes: Any) -> AnalysisSpec:  # noqa: ANN401
    """Specification of a node that reads numbers."""
    fields: dict[str, Any] = {
        "stream": _NODE,
        "work": work,
        "inputs": {_INPUT: 4},
        "robot": "drone",
        "state": _STATE,
        "external": False,
        "dormant": False,
        "triggers": (),
        "kind": "edge",
        "answers_always": False,
        "wakes": (),
    }
    return AnalysisSpec(**{**fields, **changes})


def node_of(work: Analytics[Any], host: Hand, **changes: Any) -> AnalysisNode:  # noqa: ANN401
    """An opened and started node."""
    node = spec_of(work, **changes).make(_SESSION)
    node.open(host)
    node.start(SimulatedClock())
    return node


def items(messages: Sequence[Message[Any]]) -> list[tuple[str, Any]]:
    """Stream and item of each."""
    return [(message.stream, message.item) for message in messages]


def state(stamp: int) -> VehicleState:
    """A state of the vehicle."""
    place = Odometry(np.zeros(3), np.zeros(3), 0.0)
    return VehicleState(stamp, place, Battery(1.0), VehicleMode.GROUNDED, armed=False)


def test_items_are_processed_in_their_order_with_the_newest_state() -> None:
    """A result carries the item's header; the state of a step's end counts for all its items."""
    work, host = Double(), Hand()
    node = node_of(work, host)
    host.time = 70
    arrived = [published(_INPUT, 1.0, 50), published(_INPUT, 0.0, 60, 1)]
    found = node.step(70, [*arrived, published(_STATE, state(60), 60)])
    assert items(found) == [(_NODE, 2.0), (_NODE, None)]
    assert [message.header for message in found] == [one.header for one in arrived]
    assert [message.seq for message in found] == [0, 1]
    assert work.calls == [
        "open",
        "process 1.0 at 50 on the edge",
        "process 0.0 at 60 on the edge",
    ]
    assert all(one is not None and one.stamp == 60 for one in work.vehicles)
    node.close()
    node.close()
    assert work.calls[3:] == ["close"]


def test_an_empty_message_is_passed_on_without_processing() -> None:
    """Whoever reads the results knows that the measurement led to none."""
    work = Double()
    found = node_of(work, Hand()).step(9, [published(_INPUT, None, 5)])
    assert items(found) == [(_NODE, None)]
    assert work.calls == ["open"]


def test_a_dormant_analysis_processes_what_is_measured_after_its_wake() -> None:
    """By the stamps: what was measured before is not processed, though it comes later."""
    node = node_of(Double(), Hand(), dormant=True, wakes=(_WAKE,))
    assert items(node.step(10, [published(_INPUT, 1.0, 10)])) == []
    wake = published(_WAKE, Wake(), 20)
    assert items(node.step(20, [wake, published(_INPUT, 2.0, 20)])) == []
    assert items(node.step(30, [published(_INPUT, 3.0, 20), published(_INPUT, 4.0, 21)])) == [
        (_NODE, 8.0)
    ]
    late = published(_WAKE, Wake(), 90, 1)
    assert items(node.step(90, [late, published(_INPUT, 5.0, 80)])) == [(_NODE, 10.0)]


def test_a_dormant_task_of_a_dispatcher_answers() -> None:
    """Which waits for it, with nothing."""
    node = node_of(Double(), Hand(), dormant=True, wakes=(_WAKE,), answers_always=True)
    assert items(node.step(10, [published(_INPUT, 1.0, 10)])) == [(_NODE, None)]


def test_an_analysis_that_raises_has_no_result_and_goes_on() -> None:
    """An error is told once while it stays the same, and counted."""
    host = Hand()
    node = node_of(Double(), host)
    found = []
    for number, item in enumerate([-1.0, -1.0, 3.0, -2.0]):
        found += items(node.step(number, [published(_INPUT, item, number, number)]))
    assert found == [(_NODE, None), (_NODE, None), (_NODE, 6.0), (_NODE, None)]
    assert [alert.kind for alert in host.alerts] == ["analysis_failed"] * 2
    assert host.alerts[0].text.startswith("drone/double: ValueError: negative: -1.0 at ")
    assert [alert.header.stamp for alert in host.alerts] == [0, 3]
    values = node.values()
    assert values["errors"] == {_NODE: 3}
    assert values["last_errors"] == [host.alerts[1].text]
    assert values["busy_seconds"][_NODE] > 0


def test_an_external_source_is_due_at_its_rate() -> None:
    """Each measurement has a header of its own; one without an item is told, too."""
    host, work = Hand(), Count()
    node = node_of(work, host, external=True, inputs={})
    found: list[Message[Any]] = []
    stamps = []
    for _ in range(4):
        stamps.append(node.due)
        host.time = node.due
        found += node.step(node.due, [])
    assert stamps == [NANOSECONDS * quarter // 4 for quarter in range(4)]
    assert [(message.item, message.header.stamp) for message in found] == list(
        zip([1, None, 3, 4], stamps, strict=True)
    )
    assert [message.header.id for message in found] == [0, 1, 2, 3]
    assert [(one.kind, one.text, one.values) for one in host.alerts] == [
        ("third", "three calls", {"calls": 3})
    ]
    assert node_of(Double(), Hand()).due == NEVER


def test_a_dormant_source_measures_after_its_wake() -> None:
    """It is due all the same, and says nothing."""
    work = Count()
    node = node_of(work, Hand(), external=True, inputs={}, dormant=True, wakes=(_WAKE,))
    assert items(node.step(0, [])) == []
    node.step(10, [published(_WAKE, Wake(), 10)])
    assert items(node.step(node.due, [])) == [(_NODE, 1)]
    assert work.calls == 1


def test_a_result_fires_its_triggers() -> None:
    """Before it is published, if the condition holds; a condition that raises is told."""

    def boom(result: float) -> bool:
        raise KeyError(result)

    triggers = (
        TriggerSpec("always", "wake", None),
        TriggerSpec("big", "land", lambda result: result > 5),
        TriggerSpec("boom", "land", boom),
    )
    host = Hand()
    node = node_of(Double(), host, triggers=triggers)
    assert items(node.step(1, [published(_INPUT, 1.0, 1)])) == [("always", "wake"), (_NODE, 2.0)]
    found = node.step(2, [published(_INPUT, 3.0, 2)])
    assert items(found) == [("always", "wake"), ("big", "land"), (_NODE, 6.0)]
    assert {message.header.stamp for message in found} == {2}
    assert items(node.step(3, [published(_INPUT, 0.0, 3)])) == [(_NODE, None)]
    assert {alert.kind for alert in host.alerts} == {"analysis_failed"}


class Bright(Analytics[float]):
    """The mean of a picture."""

    accepts: ClassVar[tuple[type, ...]] = (Frame,)

    def process(self, item: Frame, context: Context) -> float:  # noqa: ARG002
        """Take the mean."""
        return float(item.image.mean())


def test_a_task_refers_to_a_frame_that_the_node_has_received() -> None:
    """Of one that it has not, it says so, and the dispatcher sends it along."""
    node = node_of(Bright(), Hand(), answers_always=True, frames=("drone/cam",))
    frame = Frame(Header(4, 5, "drone/cam"), np.full((2, 2, 3), 7, np.uint8))
    assert items(node.step(5, [published("drone/cam", frame, 5, 4)])) == []
    reference = FrameReference("drone/cam", 4)
    assert items(node.step(6, [published(_INPUT, reference, 5)])) == [(_NODE, 7.0)]
    unknown = FrameReference("drone/cam", 9)
    assert items(node.step(7, [published(_INPUT, unknown, 5)])) == [(_NODE, MissingFrame(unknown))]
    assert items(node.step(8, [published(_INPUT, frame, 5)])) == [(_NODE, 7.0)]


def test_what_open_raises_is_the_callers() -> None:
    """And what was not opened is not closed."""

    class Unopened(Double):
        def open(self) -> None:
            raise OSError("no model")

    work, host = Unopened(), Hand()
    node = spec_of(work).make(_SESSION)
    with pytest.raises(OSError, match="no model"):
        node.open(host)
    node.close()
    assert work.calls == []


def test_what_close_raises_is_told() -> None:
    """What it was to write then is lost, and nobody would know."""

    class Unwritten(Double):
        def close(self) -> None:
            raise OSError("the disk is full")

    host = Hand()
    node = node_of(Unwritten(), host)
    node.close()
    assert "the disk is full" in host.alerts[0].text
    assert node.values()["errors"] == {_NODE: 1}

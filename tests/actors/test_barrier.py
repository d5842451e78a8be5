"""Lockstep's barrier counts what is under way, whatever the order in which word arrives."""

from __future__ import annotations

from random import Random

from hypothesis import given
from hypothesis import strategies as st

from aerodaas.actors.lockstep.barrier import Barrier, paths, widest
from aerodaas.dataflow.graph import Graph, Node

measurements = st.lists(
    st.tuples(st.sampled_from(["camera", "odometry"]), st.integers(0, 3)), max_size=20
)


@given(measurements, st.randoms(use_true_random=False))
def test_nothing_is_under_way_once_everyone_has_answered(
    counts: list[tuple[str, int]], random: Random
) -> None:
    """Expectations and acknowledgements cancel in any order, even word that comes early."""
    barrier = Barrier({"camera": 0, "odometry": 0})
    events: list[tuple[str, int, int]] = []
    for stamp, (source, count) in enumerate(counts):
        events.append((source, stamp, count))
        events += [(source, stamp, -1)] * count
    random.shuffle(events)
    for source, stamp, count in events:
        if count < 0:
            barrier.acknowledge(source, stamp)
        else:
            barrier.expect(source, stamp, count)
    assert barrier.clear(drain=True)
    assert barrier.waiting_for() == []


@given(st.integers(0, 5), st.integers(1, 12), st.integers(1, 4))
def test_time_goes_on_while_no_more_is_under_way_than_the_window(
    window: int, sent: int, readers: int
) -> None:
    """A window of n lets n measurements be under way; one more stops time until one is done."""
    barrier = Barrier({"camera": window})
    for stamp in range(sent):
        barrier.expect("camera", stamp, readers)
    assert barrier.clear() is (sent <= window)
    assert barrier.clear(drain=True) is False
    assert barrier.waiting_for() == (["camera"] if sent > window else [])
    for stamp in range(sent):
        for _ in range(readers - 1):
            barrier.acknowledge("camera", stamp)
    assert barrier.clear() is (sent <= window)
    for left in reversed(range(sent)):
        barrier.acknowledge("camera", left)
        assert barrier.clear() is (left <= window)


def test_a_source_without_a_window_is_nobodys_to_wait_for() -> None:
    """The recorder acknowledges alerts, too, which nobody expects."""
    barrier = Barrier({"camera": 0})
    barrier.acknowledge("alerts/drone", 5)
    assert barrier.clear(drain=True)


def test_forgetting_lets_time_go_on() -> None:
    """A reader that is gone no longer holds time up."""
    barrier = Barrier({"camera": 0})
    barrier.expect("camera", 1, 2)
    assert not barrier.clear()
    barrier.forget()
    assert barrier.clear(drain=True)


def test_paths_count_the_ends_of_every_way() -> None:
    """Each reader at the end of a way, the recorder and the drone give one word each."""
    graph = Graph()
    graph.add(Node("camera", "sensor", object, None))
    graph.add(Node("detector", "analytics", object, None, inputs=["camera"]))
    graph.add(Node("follow", "analytics", object, None, inputs=["detector"]))
    graph.add(Node("pose", "analytics", object, None, inputs=["camera", "detector"]))
    # Ways from the camera: pose directly; by the detector to follow, and to pose.
    assert paths(graph, "camera", set(), recorded=False) == 3
    assert paths(graph, "camera", {"follow"}, recorded=False) == 3
    # The recorder reads five messages: the camera's, the detector's, follow's, and pose's two.
    assert paths(graph, "camera", {"follow"}, recorded=True) == 6
    assert paths(graph, "pose", {"follow"}, recorded=False) == 0


def test_an_analysis_of_many_streams_answers_each_of_them() -> None:
    """What one picture leads to on one stream is what must find room there."""
    graph = Graph()
    graph.add(Node("camera", "sensor", object, None))
    for number in range(5):
        graph.add(Node(f"a{number}", "analytics", object, None, inputs=["camera"]))
    graph.add(Node("all", "analytics", object, None, inputs=[f"a{n}" for n in range(5)]))
    graph.add(Node("last", "analytics", object, None, inputs=["all", "a0"]))
    assert widest(graph, "last") == widest(graph, "a0") - 1 == 1
    assert widest(graph, "camera") == 6


def test_an_answer_to_what_was_forgotten_comes_too_late_to_matter() -> None:
    """A reader that was slow, not gone, must not stop time once more by answering after all."""
    barrier = Barrier({"camera": 0})
    for stamp in (1, 2):
        barrier.expect("camera", stamp, 2)
    barrier.acknowledge("camera", 1)
    barrier.forget()
    for stamp in (1, 2, 2):
        barrier.acknowledge("camera", stamp)
    assert barrier.clear(drain=True)
    barrier.expect("camera", 3, 1)
    assert not barrier.clear()
    barrier.acknowledge("camera", 3)
    assert barrier.clear(drain=True)

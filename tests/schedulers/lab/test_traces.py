"""Networks and arrivals from files in the formats of public traces."""

from __future__ import annotations

import random
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from aerodaas.cli.lab.options import workload_of
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import SchedulerError
from aerodaas.schedulers.analytics.base import MILLISECOND
from aerodaas.schedulers.lab import Network, read_arrivals, run_lab
from aerodaas.schedulers.lab.network_trace import read_bandwidth

SECOND = NANOSECONDS
MBIT = 125_000


def written(folder: Path, text: str | bytes, name: str = "trace.log") -> Path:
    """A file with this text."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rates(path: Path, seconds: list[float]) -> list[float]:
    """Mbit/s at these times of a run of ten seconds."""
    network = Network.named(f"trace:{path}", 10 * SECOND)
    return [(network.bandwidth_at(round(at * SECOND)) or 0) / MBIT for at in seconds]


def test_mahimahi_counts_packets_and_begins_anew(tmp_path: Path) -> None:
    """Four packets in 100 ms are 480 kbit/s; none in the next; over after 250 ms."""
    path = written(tmp_path, "1\n1\n50\n100\n201\n250\n")
    found = rates(path, [0, 0.15, 0.22, 0.26, 0.4])
    assert found == pytest.approx([0.48, 0, 0.48, 0.48, 0])


def test_a_cooked_trace_gives_each_rate_up_to_its_time(tmp_path: Path) -> None:
    """As Pensieve plays it: the first line only begins; then again from the second."""
    path = written(tmp_path, "100.0 9\n101.0 2.5\n103.0\t0.5\n")
    assert rates(path, [0, 0.9, 1.1, 2.9, 3.1, 4.5]) == [2.5, 2.5, 0.5, 0.5, 2.5, 0.5]


def test_what_is_sent_into_no_bandwidth_waits_for_it(tmp_path: Path) -> None:
    """At 1.1 s, 0.9 s of nothing and then 40 kB at 8 Mbit/s."""
    path = written(tmp_path, "0 1\n1 8\n2 0\n3 8\n")
    network = Network.named(f"trace:{path}", 10 * SECOND)
    nominal = 500 * MILLISECOND
    taken = network.cloud_time(nominal, 1100 * MILLISECOND)
    assert taken == nominal + (900 + 40 - 32) * MILLISECOND


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "nothing in it"),
        (" \n\n", "nothing in it"),
        ("5\n4\n", "line 2: milliseconds must not descend"),
        ("5\nx\n", "line 2: 'x' is no whole number"),
        ("5\n-6\n", "line 2: '-6' is no whole number"),
        ("5\n\n\n6 7\n", "line 4: 2 columns, where the first line has 1"),
        ("0\n0\n", "spans no time"),
        ("9" * 20 + "\n", "line 1: .* no whole number of up to 15"),
        ("999999999999\n", "line 1: the trace is longer than a day"),
        ("1 2 3\n", "not 3 columns"),
        ("0 1\n", "a single line measures nothing"),
        ("0 1\n0 2\n", "line 2: times must ascend"),
        ("0 1\n1 nan\n", "line 2: 'nan'"),
        ("0 1\n1 inf\n", "line 2: 'inf'"),
        ("0 1\n1 -3\n", "line 2: '-3'"),
        ("0 1\n1 1e300\n", "line 2: '1e300'"),
        ("0 1\ninf 2\n", "line 2: 'inf'"),
        ("0 1\n1e15 2\n", "line 2: times must ascend, by 400 days"),
        ("0 1\n1 0\n", "no line has any bandwidth"),
        ("0,1\n1,nan\n", "line 2: 'nan'"),
        ("0,1\n0,2\n", "line 2: seconds must ascend"),
        ("0,1\n1,0\n", "line 2: each Mbit/s must be positive"),
        ("seconds,mbps\n", "a heading and nothing else"),
        (b"\xff\xfe\x00", "is text"),
    ],
)
def test_a_bad_network_is_told_with_its_line(tmp_path: Path, text: str | bytes, told: str) -> None:
    """What is wrong, and where."""
    with pytest.raises(SchedulerError, match=rf"trace\.log.*{told}"):
        read_bandwidth(written(tmp_path, text), SECOND)


def test_a_huge_network_is_refused_unread(tmp_path: Path) -> None:
    """65 MiB, of which the disk holds nothing."""
    path = tmp_path / "huge.log"
    with path.open("wb") as file:
        file.truncate(65 * 2**20)
    with pytest.raises(SchedulerError, match="at most 64 MiB"):
        read_bandwidth(path, SECOND)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(
    st.one_of(
        st.text(alphabet="0123456789. ,-eEnaif\n\t", max_size=60),
        st.lists(st.integers(0, 400), min_size=1, max_size=30).map(
            lambda values: "\n".join(map(str, sorted(values)))
        ),
        st.text(max_size=40),
    )
)
def test_any_text_is_a_network_or_an_error(tmp_path: Path, text: str) -> None:
    """Times ascend from the start, no rate is negative or infinite; packets are all there."""
    path = written(tmp_path, text.encode("utf-8", "replace"))
    try:
        points = read_bandwidth(path, SECOND)
    except SchedulerError as error:
        assert str(path) in str(error)  # noqa: PT017 - either is right
        return
    stamps = [stamp for stamp, _ in points]
    assert stamps == sorted(set(stamps))
    assert all(0 <= rate < float("inf") for _, rate in points)


@given(st.lists(st.integers(1, 3000), min_size=1, max_size=200))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_mahimahi_loses_no_packet(tmp_path: Path, stamps: list[int]) -> None:
    """Bandwidth over the trace's length is 1500 bytes for each line."""
    stamps.sort()
    path = written(tmp_path, "\n".join(map(str, stamps)))
    points = list(read_bandwidth(path, SECOND))
    end = stamps[-1] * MILLISECOND
    points = [point for point in points if point[0] < end] + [(end, 0.0)]
    sent = sum((after - at) / SECOND * rate for (at, rate), (after, _) in pairwise(points))
    assert sent == pytest.approx(1500 * len(stamps))


def test_a_csv_of_times_is_a_workload(tmp_path: Path) -> None:
    """A segment at each, with a task for each of the six models; sources keep their numbers."""
    path = written(tmp_path, "seconds,source,edge\n0.5,a,0\n0.5,b,1\n2.25,a,0\n")
    workload = read_arrivals(str(path))
    tasks = workload.tasks(0, random.Random(0))
    assert (workload.edges, workload.duration) == (2, 3 * SECOND)
    assert [task.arrival / SECOND for task in tasks] == [0.5] * 6 + [2.25] * 6
    assert [task.segment for task in tasks[::6]] == [0, 1]
    assert {task.profile.model for task in tasks[:6]} == set(workload.models)
    assert {task.source for task in workload.tasks(1, random.Random(0))} == {"b"}


def test_the_lab_runs_a_trace_on_a_trace(tmp_path: Path) -> None:
    """Arrivals and network of files; all tasks are accounted for."""
    times = written(tmp_path, "0.5\n1\n1\n2\n4\n4.5\n", "seconds.csv")
    load = workload_of(f"trace:{times}", None, None)
    link = written(tmp_path, "0 1\n1 8\n2 0\n3 8\n")
    network = Network.named(f"trace:{link}", load.duration)
    result = run_lab(load, ["dems"], [0], network=network, jobs=1)
    score = result.scores["dems"][0]
    assert score.tasks == 36 == score.done + score.late + score.dropped


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("", "nothing in it"),
        ("seconds\n", "no time of it is in the run"),
        ("when,where\n1,2\n", "line 1: there is no column `seconds`"),
        ("seconds\n1\nnan\n", "line 3: 'nan' is no time"),
        ("seconds\n1\ninf\n", "line 3: 'inf' is no time"),
        ("seconds\n-1\n", "line 2: '-1' is no time"),
        ("seconds\n2\n1\n", "line 3: seconds must not descend"),
        ("seconds\nx\n", "line 2: 'x' is no number"),
        ("seconds,edge\n1,-1\n", "line 2: '-1' is no whole number"),
        ("seconds,edge\n1\n", "line 2: 1 columns"),
        ("seconds,model\n1,nope\n", "line 2: no model 'nope'"),
        ("seconds\n" + "1\n" * 200_001, "more than 200,000 arrivals"),
        (b"\xff\xfe\x00", "is text"),
    ],
)
def test_bad_arrivals_are_told_with_their_line(
    tmp_path: Path, text: str | bytes, told: str
) -> None:
    """What is wrong, and where."""
    with pytest.raises(SchedulerError, match=rf"trace\.log.*{told}"):
        read_arrivals(str(written(tmp_path, text)))

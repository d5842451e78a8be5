"""The leaderboard: one fixed set of cases, standings that can be told from chance, a page."""

from __future__ import annotations

import csv
from html.parser import HTMLParser
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodaas.cli.app import app
from aerodaas.clock import NANOSECONDS
from aerodaas.errors import AeroDaaSError, SchedulerError
from aerodaas.extensions.leaderboard.command import html_page, rank
from aerodaas.extensions.leaderboard.ranking import CASES, Extent, Leaderboard, run_leaderboard
from aerodaas.schedulers.analytics.base import AnalyticsScheduler, Decision, Drop, Resources, Task
from aerodaas.schedulers.analytics.published.dems import Dems
from aerodaas.schedulers.lab import ExecutionTimes, Network, Workload, run_lab

SHORT = Extent(seeds=8, seconds=2)
VOID = {"meta", "link", "br", "img"}


class Idle(AnalyticsScheduler):
    """Drops <everything> | all of it."""

    def task_arrived(self, task: Task, now: int) -> list[Decision]:
        """Drop it."""
        del now
        return [Drop(task)]


class Twin(Dems):
    """DEMS by another name."""


class Balanced(HTMLParser):
    """Reads a page, and fails where a tag is closed that is not open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Nothing is loaded from elsewhere."""
        assert not {"src", "href"} & {name for name, value in attrs if value != "data:,"}
        assert tag != "script"
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        """Close the last one."""
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        """Keep what is read."""
        self.text += data


@pytest.fixture(scope="module")
def board() -> Leaderboard:
    """Three schedulers: two that are the same, one that earns nothing."""
    return run_leaderboard(["dems", Idle, Twin], extent=SHORT, jobs=1)


def test_the_better_stands_above_and_the_same_share_a_place(board: Leaderboard) -> None:
    """What drops all is last, with nothing, and behind; a twin of the leader is not."""
    places = [(one.scheduler, one.rank, one.completion_rank) for one in board.standings]
    assert places == [("Twin", 1, 1), ("dems", 1, 1), ("Idle", 3, 3)]
    assert [one.is_behind for one in board.standings] == [False, False, True]
    last = board.standings[-1]
    assert (last.utility.value, last.completion.value) == (0, 0)


@pytest.mark.slow
def test_a_standing_is_the_mean_of_what_the_lab_says(board: Leaderboard) -> None:
    """Case by case, as `aerodaas lab run` gives it with the words of the case."""
    first = board.standings[0]
    for case in CASES:
        load = Workload.named(case.workload, SHORT.seconds * NANOSECONDS)
        result = run_lab(
            load,
            ["dems"],
            range(SHORT.seeds),
            network=Network.named(case.network, load.duration),
            times=ExecutionTimes.named(case.times),
            resources=Resources(cloud_slots=case.cloud_slots),
            jobs=1,
        )
        figures = result.figures("dems")
        assert first.cases[case.name] == (figures["of bound"], figures["completion"])
    mean = sum(utility.value for utility, _ in first.cases.values()) / len(CASES)
    assert first.utility.value == pytest.approx(mean)


def test_one_seed_ranks_nothing() -> None:
    """It has no interval."""
    with pytest.raises(SchedulerError, match="two seeds"):
        run_leaderboard(["edf"], extent=Extent(1, 1))


def test_the_page_stands_alone_and_runs_nothing(board: Leaderboard) -> None:
    """Names and ideas are a stranger's text; all tags close, nothing is loaded."""
    ideas = {one.scheduler: f"<script>{one.scheduler}</script>" for one in board.standings}
    reader = Balanced()
    reader.feed(html_page(board, ideas, "abc+ with changes"))
    assert reader.open == []
    for word in ("<script>Idle</script>", *(case.name for case in CASES), "abc+ with changes"):
        assert word in reader.text, word
    assert "first: 1 of 2" in reader.text


def test_the_command_writes_page_and_figures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row for each scheduler and case, and one for its standing."""
    out = tmp_path / "some" / "board"
    rank(["edf", "dems"], Extent(2, 1), jobs=1, out=out)
    assert "leaderboard.html" in capsys.readouterr().out
    rows = list(csv.DictReader((out / "leaderboard.csv").open(encoding="utf-8")))
    assert len(rows) == 2 * (1 + len(CASES))
    assert "<th>dems</th>" in (out / "leaderboard.html").read_text(encoding="utf-8")


def test_what_cannot_be_is_told_before_the_simulations(tmp_path: Path) -> None:
    """No scheduler, one that there is not, a folder that is a file."""
    (tmp_path / "file").write_text("")
    for words, told in (
        (("--only",), "--only needs a --scheduler"),
        (("-s", "nope", "--only"), "no analytics scheduler is called 'nope'"),
        (("-s", "edf", "--only", "-o", str(tmp_path / "file")), "cannot write into"),
    ):
        outcome = CliRunner().invoke(app, ["lab", "leaderboard", *words], env={"COLUMNS": "200"})
        assert isinstance(outcome.exception, AeroDaaSError)
        assert outcome.exception.exit_code == 2
        assert told in str(outcome.exception)

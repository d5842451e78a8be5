"""The leaderboard as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from aerodaas.cli.leaderboard.origin import Origin
from aerodaas.recording.report.page.document import document, marked, paragraph, section, table
from aerodaas.schedulers.lab.leaderboard import CASES, SET, Leaderboard, Standing
from aerodaas.schedulers.lab.metrics import Mean

__all__ = ["html_page"]

_OWN = """class Mine(AnalyticsScheduler):
    ...

$ aerodaas lab leaderboard --scheduler mine.py:Mine -o board"""


def html_page(board: Leaderboard, ideas: Mapping[str, str], origin: Origin) -> str:
    """The whole page.

    Args:
        board: The standings.
        ideas: A line about each scheduler.
        origin: Where the figures come from.
    """
    seeds, seconds = board.extent.seeds, board.extent.seconds
    head = paragraph(
        f"Set {SET}: {len(CASES)} cases, {seeds} seeds (0 to {seeds - 1}) of {seconds} s each, the "
        "same sample paths for all."
    )
    return document(
        "Leaderboard of analytics schedulers",
        [head],
        [
            section("Standings", _standings(board, ideas), _note(board), wide=True),
            section("Utility in each case, % of bound", _by_case(board), wide=True),
            section("The cases", _cases(), wide=True),
            section("How it is measured", *(paragraph(text) for text in _METHOD.splitlines())),
            section("Enter your own", *_entering()),
        ],
        origin.line(),
    )


_METHOD = """\
Utility is benefit less cost of the tasks that end in time, minus the costs of those that ran \
in vain. It is divided by what a clairvoyant could reach at most on the very same sample path, an \
upper bound that none exceeds and that may lie above the best possible. It can be negative.
In time is the share of all tasks that ended before their deadlines, of dropped ones, too. A \
scheduler may do well by one and badly by the other: tasks differ in worth.
Each seed's figure is the mean over the cases; intervals are 95 %, Student's t over the seeds. \
Behind the first means p < 0.05 by a paired permutation test over the seeds, corrected by Holm for \
all that are compared. Schedulers with the same utility share a place.
Seeds give the same figures on every machine."""


def _standings(board: Leaderboard, ideas: Mapping[str, str]) -> str:
    rows = [
        f'<tr{" class=first" if one.rank == 1 else ""}><td class="number">{one.rank}</td>'
        f"<th>{escape(one.scheduler)}</th>{_bar(one.utility, dagger=one.is_behind)}"
        f'{_bar(one.completion)}<td class="number">{one.completion_rank}</td>'
        f"<td>{marked(ideas[one.scheduler])}</td></tr>"
        for one in board.standings
    ]
    return _scrolled(
        '<th class="number">#</th><th>scheduler</th><th>utility, % of bound</th>'
        '<th>in time, %</th><th class="number"># by time</th><th>idea</th>',
        rows,
        "standings",
    )


def _bar(mean: Mean, *, dagger: bool = False) -> str:
    """A share as a bar from 0 to 1, its interval as a whisker, and its figures."""
    low, high = (min(max(100 * (mean.value + side * mean.margin), 0), 100) for side in (-1, 1))
    value = min(max(100 * mean.value, 0), 100)
    mark = '<abbr title="significantly behind the first">†</abbr>' if dagger else ""
    return (
        f'<td class="bar"><span class="track"><span class="fill" style="width:{value:.2f}%"></span>'
        f'<span class="whisker" style="left:{low:.2f}%;width:{high - low:.2f}%"></span></span>'
        f'<span class="figure">{100 * mean.value:.1f} <small>±{100 * mean.margin:.1f}</small>{mark}'
        "</span></td>"
    )


def _note(board: Leaderboard) -> str:
    behind = sum(one.is_behind for one in board.standings)
    return paragraph(
        f"† significantly behind the first: {behind} of {len(board.standings) - 1}.", "note"
    )


def _by_case(board: Leaderboard) -> str:
    best = {
        case.name: max(one.cases[case.name][0].value for one in board.standings) for case in CASES
    }
    rows = [
        f"<tr><th>{escape(one.scheduler)}</th>{_tints(one, best)}</tr>" for one in board.standings
    ]
    titles = "".join(f'<th class="number">{escape(case.name)}</th>' for case in CASES)
    return _scrolled(f"<th>scheduler</th>{titles}", rows, "heat")


def _tints(one: Standing, best: Mapping[str, float]) -> str:
    """A cell for each case, the darker the nearer to the bound; the best of a case is bold."""
    cells = []
    for case, (utility, _) in one.cases.items():
        tint = 0.5 * min(max(utility.value, 0), 1) ** 2
        text = f"{100 * utility.value:.1f}"
        text = f"<b>{text}</b>" if utility.value >= best[case] - 1e-9 else text
        title = f"{one.scheduler}, {case}: ±{100 * utility.margin:.1f}"
        cells.append(
            f'<td class="number" style="background:rgb(0 114 178 / {tint:.2f})" '
            f'title="{escape(title)}">{text}</td>'
        )
    return "".join(cells)


def _cases() -> str:
    return table(
        ("case", "drones and models", "network", "execution times", "cloud slots", ""),
        [
            (case.name, case.workload, case.network, case.times, case.cloud_slots, case.about)
            for case in CASES
        ],
    )


def _entering() -> tuple[str, ...]:
    return (
        paragraph(
            "Write a class that is told of tasks and answers with decisions, and give its file. "
            "`--full` takes 30 seeds of 300 s."
        ),
        f"<pre>{escape(_OWN)}</pre>",
        paragraph(
            "Its row appears among the others; the figures of the others stay the same. To see one "
            "case alone: `aerodaas lab run` with the words of its row above."
        ),
    )


def _scrolled(titles: str, rows: list[str], kind: str) -> str:
    return (
        f'<div class="scroll"><table class="{kind}"><thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(rows)}</tbody></table></div>"
    )

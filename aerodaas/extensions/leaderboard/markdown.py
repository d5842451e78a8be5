"""The leaderboard as Markdown, for a page of documentation or a README."""

from __future__ import annotations

from collections.abc import Mapping

from aerodaas.extensions.leaderboard.origin import Origin
from aerodaas.extensions.leaderboard.ranking import CASES, SET, Leaderboard, Rank
from aerodaas.schedulers.lab.metrics import Mean

__all__ = ["markdown_page"]


def markdown_page(board: Leaderboard, ideas: Mapping[str, str], origin: Origin) -> str:
    """The standings, each case's utility, and what the cases are.

    Args:
        board: The standings.
        ideas: A line about each scheduler.
        origin: Where the figures come from.
    """
    cases = [case.name for case in CASES]
    seeds = f"{board.extent.seeds} seeds of {board.extent.seconds} s each"
    return "\n".join(
        [
            f"Set {SET}: {len(CASES)} cases, {seeds}; means with 95 % intervals.",
            "",
            "| | scheduler | utility, % of bound | in time % | |",
            "|---|---|---|---|---|",
            *(_standing(one, ideas[one.scheduler]) for one in board.standings),
            "",
            "† significantly behind the first (p < 0.05, Holm).",
            "",
            "Utility in each case, % of bound:",
            "",
            f"| scheduler | {' | '.join(cases)} |",
            f"|---|{'---|' * len(cases)}",
            *(_cases(one) for one in board.standings),
            "",
            "| case | drones | network | times | cloud slots | |",
            "|---|---|---|---|---|---|",
            *(
                f"| {case.name} | `{case.workload}` | `{case.network}` | `{case.times}` "
                f"| {case.cloud_slots} | {case.about} |"
                for case in CASES
            ),
            "",
            origin.line(),
            "",
        ]
    )


def _standing(one: Rank, idea: str) -> str:
    mark = " †" if one.is_behind else ""
    shown = f"{_percent(one.utility)}{mark} | {_percent(one.completion)}"
    return f"| {one.rank} | `{_cell(one.scheduler)}` | {shown} | {_cell(idea)} |"


def _cases(one: Rank) -> str:
    shares = " | ".join(f"{100 * utility.value:.1f}" for utility, _ in one.cases.values())
    return f"| `{_cell(one.scheduler)}` | {shares} |"


def _percent(mean: Mean) -> str:
    return f"{100 * mean.value:.1f} ± {100 * mean.margin:.1f}"


def _cell(text: str) -> str:
    """Text that stays within its cell."""
    return text.replace("|", "\\|").replace("`", "'").replace("\n", " ")

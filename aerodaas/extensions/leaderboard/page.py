"""The leaderboard as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from aerodaas.extensions.leaderboard.origin import Origin
from aerodaas.extensions.leaderboard.ranking import CASES, SET, Leaderboard
from aerodaas.recording.report.page.document import render_page

__all__ = ["html_page"]


def html_page(board: Leaderboard, ideas: Mapping[str, str], origin: Origin) -> str:
    """The whole page.

    Args:
        board: The standings.
        ideas: A line about each scheduler.
        origin: Where the figures come from.
    """
    return render_page(
        Path(__file__).with_name("leaderboard.html"),
        title="Leaderboard of analytics schedulers",
        origin=origin.line(),
        board=board,
        ideas=ideas,
        set_name=SET,
        cases=CASES,
        case_rows=[
            (case.name, case.workload, case.network, case.times, case.cloud_slots, case.about)
            for case in CASES
        ],
        best={
            case.name: max(one.cases[case.name][0].value for one in board.standings)
            for case in CASES
        },
        share=lambda value: min(max(value, 0.0), 1.0),
    )

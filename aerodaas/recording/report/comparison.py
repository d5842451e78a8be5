"""HTML page that compares two flights side by side."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from aerodaas.errors import RecordingError
from aerodaas.recording.report.page.document import render_page
from aerodaas.recording.report.page.flight import figures, origin_line
from aerodaas.recording.report.report import Report, read_report
from aerodaas.recording.report.section import Plot

__all__ = ["comparison_page", "write_comparison"]


def write_comparison(first: str | Path, second: str | Path, page: str | Path) -> Path:
    """Write an HTML page that compares two recordings side by side.

    Args:
        first: The first MCAP file, A in the page.
        second: The second MCAP file, B in the page.
        page: File of the page; replaced if it exists.

    Returns:
        The file of the page.

    Raises:
        RecordingError: If a recording cannot be read or the page cannot be written.
    """
    page = Path(page)
    text = comparison_page(
        f"{Path(first)}", read_report(first), f"{Path(second)}", read_report(second)
    )
    try:
        page.parent.mkdir(parents=True, exist_ok=True)
        page.write_text(text, encoding="utf-8")
    except OSError as error:
        raise RecordingError(f"cannot write the comparison to {page}: {error.strerror}") from None
    return page


def comparison_page(first_name: str, first: Report, second_name: str, second: Report) -> str:
    """Return the HTML page: figures with their differences, latencies, then each plot twice.

    Args:
        first_name: Name of the first recording.
        first: Report of the first recording.
        second_name: Name of the second recording.
        second: Report of the second recording.
    """
    titles = dict.fromkeys((first.summary.title, second.summary.title))
    return render_page(
        "comparison.html",
        title=" and ".join(titles) + ", compared",
        origin="",
        compared=[
            (letter, name, origin_line(report.summary))
            for letter, name, report in (("A", first_name, first), ("B", second_name, second))
        ],
        figures=_figure_rows(first, second),
        latencies=list(_latency_rows(first, second)),
        plots=_plots(first.plots, second.plots),
    )


def _figure_rows(first: Report, second: Report) -> Iterator[tuple[object, ...]]:
    one, other = figures(first.summary), figures(second.summary)
    for name in dict.fromkeys([*one, *other]):
        a, b = one.get(name, ""), other.get(name, "")
        numbers = isinstance(a, int | float) and isinstance(b, int | float)
        yield name, a, b, (b - a) if numbers else ""  # type: ignore[operator]


def _latency_rows(first: Report, second: Report) -> Iterator[tuple[object, ...]]:
    one, other = first.summary.latencies, second.summary.latencies
    for stream in dict.fromkeys([*one, *other]):
        a, b = one.get(stream), other.get(stream)
        yield (
            stream,
            a.median_ms if a else "",
            b.median_ms if b else "",
            a.p99_ms if a else "",
            b.p99_ms if b else "",
        )


def _plots(first: list[Plot], second: list[Plot]) -> Iterator[tuple[str, list[Plot | None]]]:
    """Yield the title of each plot, with that of A and that of B."""
    pairs: dict[str, list[Plot | None]] = {}
    for side, plots in enumerate((first, second)):
        for plot in plots:
            pairs.setdefault(plot.name, [None, None])[side] = plot
    for pair in pairs.values():
        yield next(plot.title for plot in pair if plot is not None), pair

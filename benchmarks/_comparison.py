"""The figures of all benchmarks as one document, and as a table beside an earlier one's."""

from __future__ import annotations

import json
import math
import subprocess
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from _aims import Key, aim_of
from _report import machine_line, shown
from rich.box import SIMPLE_HEAD
from rich.table import Table
from rich.text import Text

__all__ = ["RESULTS", "Comparison", "Results", "committed", "figures", "read"]

RESULTS = Path(__file__).with_name("results.json")
"""Where the figures of a quiet machine are committed."""
Results = dict[str, Any]
"""Machine, versions, revision and date, and under "benchmarks" by name what each one's command
was and what it reported: titles, units by figure, and rows with their cases."""
Figure = tuple[float, str]
"""A value and its unit."""
_NOISE = 0.1
"""Share by which a figure may differ without being coloured: short runs are no more certain."""
_COUNTED = frozenset(("", "k", "frames", "files", "lines", "1000 lines", "asked for", "a frame"))
"""Units of what is counted, and is neither better nor worse for being more."""
_NEITHER = frozenset(("simulated", "link", "analysis", "bare ort"))
"""Figures that say what was measured, not how well."""
_MORE_IS_BETTER = frozenset(("factor", "speed-up", "rate", "within 5 ms", "within 20 ms"))


def read(path: Path) -> Results:
    """Read the results of an earlier run; raises ValueError, with the remedy, if they are none."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ValueError(f"{path} cannot be read: {error}") from None
    if not isinstance(found, dict) or "benchmarks" not in found or "machine" not in found:
        raise ValueError(f"{path} is not written by benchmarks/all.py --json")
    return found


def committed(path: Path = RESULTS) -> Results | None:
    """The results that were committed last; None if none were, or outside git."""
    command = ["git", "show", f"HEAD:./{path.name}"]
    try:
        done = subprocess.run(command, cwd=path.parent, capture_output=True, check=True)  # noqa: S603 - constant
    except (OSError, subprocess.CalledProcessError):
        return None
    found: Results = json.loads(done.stdout)
    return found


def figures(results: Results) -> dict[Key, Figure]:
    """Every figure that was measured.

    Raises ValueError if two rows of a benchmark have the same name.
    """
    found: dict[Key, Figure] = {}
    for name, one in results["benchmarks"].items():
        for report in one["reports"]:
            for row in report["rows"]:
                for figure, unit in report["units"].items():
                    key = (name, row["case"].strip(), figure)
                    if key in found:
                        raise ValueError(f"{name} has two rows {row['case']!r}")
                    if row[figure] is not None:
                        found[key] = (row[figure], unit)
    return found


@dataclass(frozen=True)
class Comparison:
    """Results, and earlier ones if there are any."""

    now: Results
    before: Results | None

    @property
    def same_machine(self) -> bool:
        """True if ratios mean something: processor and number of cores are those of before."""
        if self.before is None:
            return True
        kinds = ("cpu", "cores")
        return all(self.now["machine"].get(k) == self.before["machine"].get(k) for k in kinds)

    def tables(self) -> Iterator[Table]:
        """A table of each report: every figure, its ratio to the earlier one, and the aims."""
        now, before = figures(self.now), {} if self.before is None else figures(self.before)
        values = {key: value for key, (value, _) in now.items()}
        for name, one in self.now["benchmarks"].items():
            for report in one["reports"]:
                table = Table(
                    title=Text.assemble((name, "bold"), f"  {report['benchmark']}"),
                    title_justify="left",
                    box=SIMPLE_HEAD,
                    padding=(0, 1),
                    pad_edge=False,
                )
                table.add_column("case", no_wrap=True)
                for figure, unit in report["units"].items():
                    table.add_column(f"{figure}\n{unit}", justify="right", no_wrap=True)
                table.add_column("aim", no_wrap=True)
                for row in report["rows"]:
                    keys = [(name, row["case"].strip(), figure) for figure in report["units"]]
                    cells = (self._cell(key, now.get(key), before.get(key)) for key in keys)
                    table.add_row(row["case"], *cells, _aims(keys, values))
                yield table

    def _cell(self, key: Key, now: Figure | None, before: Figure | None) -> Text:
        """A figure, and by how many times it is the earlier one of the same unit."""
        if now is None:
            return Text("-")
        (value, unit), text = now, Text(shown(now[0]))
        if before is not None and before[1] == unit:
            earlier = before[0]
            if earlier:
                text.append(" ").append(self._ratio(key[2], unit, value / earlier))
            elif value:
                text.append(" (was 0)")
        return text

    def _ratio(self, figure: str, unit: str, ratio: float) -> Text:
        text = Text(f"x{ratio:.2f}", style="dim")
        if not self.same_machine or unit in _COUNTED or figure in _NEITHER:
            return text
        gain = ratio if figure in _MORE_IS_BETTER else 1 / ratio if ratio else math.inf
        if gain > 1 + _NOISE:
            text.stylize("not dim green")
        elif gain < 1 / (1 + _NOISE):
            text.stylize("not dim red")
        return text

    def notes(self) -> Iterable[str]:
        """Sentences below the table."""
        yield machine_line(self.now["machine"])
        if self.before is None:
            yield "nothing to compare with: no results are committed yet"
        else:
            before = self.before
            yield f"before: revision {before['revision'][:12]}, {before['made'][:10]}"
            if not self.same_machine:
                was = machine_line(before["machine"])
                yield f"before was another machine, so that ratios mean little: {was}"
            gone = figures(before).keys() - figures(self.now).keys()
            for name in self.now["benchmarks"]:
                if cases := sorted({case for one, case, _ in gone if one == name}):
                    yield f"{name} no longer measures all of: {'; '.join(cases)}"
        values = {key: value for key, (value, _) in figures(self.now).items()}
        judged = [held for key in values if (held := _held(key, values)) is not None]
        if judged:
            yield f"{sum(judged)} of {len(judged)} aims met"


def _held(key: Key, values: Mapping[Key, float]) -> bool | None:
    """Whether a figure's aim is met; None without one, or without what it is held against."""
    aim = aim_of(key)
    if aim is None or key not in values or (bound := aim.bound(values)) is None:
        return None
    return aim.met(values[key], bound)


def _aims(keys: Iterable[Key], values: Mapping[Key, float]) -> Text:
    """The aims of a row, and whether they are met."""
    return Text("\n").join(_aim(key, values) for key in keys if aim_of(key) is not None)


def _aim(key: Key, values: Mapping[Key, float]) -> Text:
    aim = aim_of(key)
    assert aim is not None  # noqa: S101 - asked for figures with one
    bound = aim.bound(values)
    limit = f"{aim.limit:g}" if bound is None else f"{bound:.3g}"
    words = f"{key[2]} at {'least' if aim.least else 'most'} {limit}"
    words += f" ({aim.limit:g} of {aim.of})" if aim.of else ""
    held = _held(key, values)
    if held is None:
        return Text(f"{words}: not measured")
    return Text.assemble(words, ": ", ("met", "green") if held else ("missed", "yellow"))

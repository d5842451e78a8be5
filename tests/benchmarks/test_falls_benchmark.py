"""The benchmark of falls: who falls away from a Tello's lens is told, who walks is not."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bench_runs import run_benchmark


@pytest.mark.slow
def test_falls_are_told_and_walks_are_not(tmp_path: Path) -> None:
    """On renders, by the shipped models."""
    path = tmp_path / "falls.json"
    words = ["--falls", "1", "--walks", "1", "--duration", "20", "--json", str(path)]
    done = run_benchmark("falls", *words)
    assert done.returncode == 0, done.stderr
    rows = {row["case"]: row for row in json.loads(path.read_text())["rows"]}
    assert rows["away"]["told"] == 100
    assert rows["away"]["after"] < 3.0
    assert [row["false"] for row in rows.values()] == [0, 0, 0, 0]


def test_what_was_not_measured_is_shown_as_such(tmp_path: Path) -> None:
    """Walks have no falls to be told: a dash in the table, null in the file."""
    path = tmp_path / "falls.json"
    words = ["--falls", "0", "--walks", "0", "--json", str(path)]
    done = run_benchmark("falls", *words)
    assert done.returncode == 0, done.stderr
    assert "nan" not in done.stdout
    rows = json.loads(path.read_text(), parse_constant=pytest.fail)["rows"]
    assert {row["told"] for row in rows} == {None}

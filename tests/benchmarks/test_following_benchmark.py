"""The following benchmark flies, prints its aims' figures and writes them."""

from __future__ import annotations

import json
from pathlib import Path

from bench_runs import run_benchmark


def test_a_short_walk_is_measured(tmp_path: Path) -> None:
    """By true boxes: the person is in view, the height held, and the figures say so."""
    path = tmp_path / "following.json"
    words = ["--speeds", "0.5", "--seeds", "1", "--duration", "22", "--json", str(path)]
    done = run_benchmark("following", *words)
    assert done.returncode == 0, done.stderr
    (row,) = json.loads(path.read_text())["rows"]
    assert row["case"] == "0.5 m/s"
    assert row["in view"] > 95
    assert row["height"] == 100
    assert row["distance"] > 80

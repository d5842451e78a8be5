"""The schedulers' benchmarks are commands that explain themselves and write their figures."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bench_runs import run_benchmark


@pytest.mark.parametrize(
    ("name", "arguments", "cases"),
    [
        ("schedulers", "--workload 2D-P --case nominal --seeds 2 --duration 4", 17),
        ("decision", "--scheduler edf,margin --waiting 5,20 --rounds 10", 4),
        ("lab", "--scheduler edf --edges 1 --duration 2", 2),
        ("fairness", "--seeds 1 --duration 4", 12),
    ],
)
def test_it_prints_a_table_and_writes_the_same_figures(
    name: str, arguments: str, cases: int, tmp_path: Path
) -> None:
    """With units, machine, versions and revision."""
    out = tmp_path / "out.json"
    done = run_benchmark(name, *arguments.split(), "--json", str(out))
    assert done.returncode == 0, done.stderr
    found = json.loads(out.read_text())
    assert len(found["rows"]) == cases
    assert found["rows"][0]["case"] in done.stdout
    assert set(found["units"]) <= set(found["rows"][0])
    assert found["machine"]["cores"] >= 1

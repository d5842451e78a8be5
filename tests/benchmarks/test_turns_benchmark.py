"""The benchmark of a drone's turn flies without streams and tells its figure."""

from __future__ import annotations

from bench_runs import run_benchmark


def test_a_turn_is_measured() -> None:
    """One number, microseconds, which `simulation.py` reads."""
    done = run_benchmark("_turns")
    assert done.returncode == 0, done.stderr
    assert float(done.stdout) > 0

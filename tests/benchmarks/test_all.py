"""All benchmarks together: failures, what is missing, and the comparison with earlier figures."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import psutil
import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner, Result

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "benchmarks"))

import _aims  # noqa: E402 - benchmarks are no package
import all as suite_run  # noqa: E402
from _comparison import Comparison, committed  # noqa: E402
from _suite import Benchmark, Need  # noqa: E402

QUICK = ("--scheduler", "edf", "--waiting", "5", "--rounds", "10")
GREEN, RED = "\x1b[32m", "\x1b[31m"


def invoke(monkeypatch: pytest.MonkeyPatch, suite: list[Benchmark], *words: str) -> Result:
    """Run the command with these benchmarks; `words` name the earlier figures, if any."""
    monkeypatch.setattr(suite_run, "SPEED", tuple(suite))
    monkeypatch.setattr(suite_run, "committed", lambda: None)
    monkeypatch.setattr(suite_run, "_SETTLE", 0.0)
    app = typer.Typer()
    app.command()(suite_run.main)
    return CliRunner(env={"COLUMNS": "200"}).invoke(app, words)


def results(**values: float | None) -> dict[str, Any]:
    """Results of one benchmark, whose figures are milliseconds, with one row."""
    report = {
        "benchmark": "capture to command",
        "units": dict.fromkeys(values, "ms"),
        "rows": [{"case": "one node", **values}],
        "notes": [],
    }
    return {
        "made": "2026-01-02T03:04:05+00:00",
        "revision": "1234567890abcdef",
        "machine": {"cpu": "a processor", "cores": 2, "memory_gib": 8.0, "system": "Linux"},
        "benchmarks": {"latency": {"command": "python", "seconds": 1, "reports": [report]}},
    }


def printed(now: dict[str, Any], before: dict[str, Any] | None) -> str:
    """The tables and notes, with colours."""
    comparison = Comparison(now, before)
    out = io.StringIO()
    console = Console(file=out, width=200, force_terminal=True, color_system="standard")
    for table in comparison.tables():
        console.print(table)
    return out.getvalue() + "\n".join(comparison.notes())


@pytest.mark.slow
def test_one_that_fails_is_told_and_the_others_run(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """By name, with its last line; the figures of the others are written."""
    out = tmp_path / "new" / "results.json"
    suite = [
        Benchmark("hop", ("--nonsense",)),
        Benchmark("lab", ("--help",)),
        Benchmark("decision", QUICK),
    ]
    done = invoke(monkeypatch, suite, "--json", str(out))
    assert done.exit_code == 1
    assert "lab failed: it wrote no figures" in done.output
    assert "hop failed: No such option: --nonsense" in done.output
    assert "edf 5" in done.output
    found = json.loads(out.read_text())
    failed = {"hop": "No such option: --nonsense", "lab": "it wrote no figures"}
    assert found["failed"] == failed
    assert list(found["benchmarks"]) == ["decision"]
    assert found["benchmarks"]["decision"]["reports"][0]["units"]["mean"] == "us"
    assert {"made", "revision", "machine", "load", "versions", "seconds"} < found.keys()
    assert {"numpy", "python"} <= found["versions"].keys()


def test_what_is_missing_is_told_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """One that cannot run is left out, which is no failure; one without its peer runs."""
    out = tmp_path / "results.json"
    gone = Need("a radio", lambda: False, "buy one")
    peer = Need("a rival", lambda: False, "install it", without=("--rounds", "11"))
    here = Need("a chair", lambda: True, "sit down", without=("--nonsense",))
    suite = [
        Benchmark("hop", needs=(gone,)),
        Benchmark("decision", QUICK, needs=(peer, here)),
    ]
    done = invoke(monkeypatch, suite, "--json", str(out))
    assert done.exit_code == 0, done.output
    assert "hop was left out without a radio: buy one" in done.output
    assert "decision was run without a rival: install it" in done.output
    assert "sit down" not in done.output
    found = json.loads(out.read_text())
    assert found["benchmarks"]["decision"]["command"].endswith("--rounds 10 --rounds 11")
    listed = invoke(monkeypatch, suite, "--list")
    assert "left out without a radio: buy one" in listed.output
    assert "python benchmarks/paper.py" in listed.output


def test_only_those_named_are_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """And who names another one is told which there are, or that one's own command."""
    out = tmp_path / "results.json"
    suite = [Benchmark("hop", ("--nonsense",)), Benchmark("decision", QUICK)]
    done = invoke(monkeypatch, suite, "--only", "decision", "--json", str(out))
    assert done.exit_code == 0
    found = json.loads(out.read_text())
    assert list(found["benchmarks"]) == ["decision"]
    assert found["left_out"] == found["without"] == found["failed"] == {}
    for name, told in (("nothing", "decision"), ("paper", "benchmarks/paper.py")):
        refused = invoke(monkeypatch, suite, "--only", name)
        assert refused.exit_code == 2
        assert told in refused.output


def test_a_busy_machine_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """One on which others wanted to run when it began."""
    for load, told in ((3.0, True), (0.1, False)):
        monkeypatch.setattr(psutil, "getloadavg", lambda load=load: (load, 0.0, 0.0))
        done = invoke(monkeypatch, [Benchmark("decision", QUICK)])
        assert ("not a quiet machine: 3 processes" in done.output) is told


def test_ratios_are_coloured_by_what_is_better() -> None:
    """Twice the time is red, twice the speed green, and a twentieth neither."""
    before = results(median=1.0, factor=1.0, p99=1.0, lost=2.0, more=0.0)
    text = printed(results(median=2.0, factor=2.0, p99=1.05, lost=None, more=3.0), before)
    assert f"2 {RED}x2.00" in text
    assert f"2 {GREEN}x2.00" in text
    assert f"{RED}x1.05" not in text
    assert f"{GREEN}x1.05" not in text
    assert "x1.05" in text
    assert "3 (was 0)" in text
    assert "revision 1234567890ab, 2026-01-02" in text
    assert "latency no longer measures all of: one node" in text


def test_aims_are_shown_with_whether_they_are_met(monkeypatch: pytest.MonkeyPatch) -> None:
    """At most, at least, and by another case's figure, which may not have been measured."""
    aims = (
        _aims.Aim("latency", "* node", "median", 5.0),
        _aims.Aim("latency", "one node", "factor", 30.0, least=True),
        _aims.Aim("latency", "one node", "p99", 0.5, of="rival"),
    )
    monkeypatch.setattr(_aims, "AIMS", aims)
    now = results(median=5.0, factor=29.0, p99=2.0)
    text = printed(now, None)
    assert f"median at most 5: {GREEN}met" in text
    assert "factor at least 30: \x1b[33mmissed" in text
    assert "p99 at most 0.5 (0.5 of rival): not measured" in text
    assert "1 of 2 aims met" in text
    assert "nothing to compare with" in text
    assert f"factor at least 30: {GREEN}met" in printed(results(factor=30.0), None)
    rival = {"case": "rival", "median": 1.0, "factor": 1.0, "p99": 4.0}
    now["benchmarks"]["latency"]["reports"][0]["rows"].append(rival)
    assert f"p99 at most 2 (0.5 of rival): {GREEN}met" in printed(now, None)


def test_the_committed_results_are_those_of_the_last_commit(tmp_path: Path) -> None:
    """Whatever has been written since; and none at all before the first."""
    path = tmp_path / "results.json"
    git = ["git", "-c", "user.name=a", "-c", "user.email=a@b", "-C", str(tmp_path)]
    assert committed(path) is None
    subprocess.run([*git, "init", "--quiet"], check=True)
    assert committed(path) is None
    path.write_text(json.dumps(results(median=1.0)), encoding="utf-8")
    subprocess.run([*git, "add", "results.json"], check=True)
    subprocess.run([*git, "commit", "--quiet", "--message", "one"], check=True)
    path.write_text(json.dumps(results(median=2.0)), encoding="utf-8")
    subprocess.run([*git, "add", "results.json"], check=True)
    assert committed(path) == results(median=1.0)


@pytest.mark.parametrize("content", ["{", "[]", '{"rows": []}', None])
def test_what_are_no_results_is_refused(
    content: str | None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Before anything is run."""
    path = tmp_path / "other.json"
    if content is not None:
        path.write_text(content, encoding="utf-8")
    suite = [Benchmark("hop", ("--nonsense",))]
    done = invoke(monkeypatch, suite, "--against", str(path))
    assert done.exit_code == 2
    assert "other.json" in done.output
    assert "failed" not in done.output

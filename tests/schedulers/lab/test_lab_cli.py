"""`aerodaas lab` on the command line."""

from __future__ import annotations

import csv
from pathlib import Path

from typer.testing import CliRunner

from aerodaas.cli.lab.app import app
from aerodaas.errors import AeroDaaSError

_MINE = """
from aerodaas.schedulers.analytics import AnalyticsScheduler, Drop

class Mine(AnalyticsScheduler):
    def task_arrived(self, task, now):
        return [Drop(task)]
"""


def _run(*arguments: str) -> tuple[int, str]:
    outcome = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "220"})
    return outcome.exit_code, outcome.output


def test_a_comparison_with_ones_own_class(tmp_path: Path) -> None:
    """A table, plots and a file of figures."""
    mine = tmp_path / "mine.py"
    mine.write_text(_MINE)
    out, plots = tmp_path / "out.csv", tmp_path / "plots"
    code, text = _run(
        *("run", "-w", "2D-P", "-s", f"dems,{mine}:Mine", "--seeds", "2", "--duration", "5"),
        *("--jobs", "1", "--csv", str(out), "--plots", str(plots)),
    )
    assert code == 0, text
    assert "dems" in text
    assert "of bound" in text
    rows = csv.DictReader(out.open(encoding="utf-8"))
    found = {(row["scheduler"], row["figure"]): float(row["mean"]) for row in rows}
    assert found[f"{mine}:Mine", "completion"] == 0 < found["dems", "completion"]
    assert len(list(plots.glob("*.png"))) == 3


def test_options_given_several_times_all_count(tmp_path: Path) -> None:
    """Each workload and scheduler has its rows, in the file for tables, too."""
    out = tmp_path / "figures.csv"
    words = ("-w", "2D-P", "-w", "2D-A,3D-P", "-s", "edf", "-s", "sjf,dems")
    code, text = _run(
        *("run", *words, "--seeds", "2", "--duration", "5", "--jobs", "1", "--csv", str(out))
    )
    assert code == 0, text
    rows = list(csv.DictReader(out.open(encoding="utf-8")))
    assert {(row["workload"], row["scheduler"]) for row in rows} == {
        (workload, scheduler)
        for workload in ("2D-P", "2D-A", "3D-P")
        for scheduler in ("edf", "sjf", "dems")
    }
    assert {"qos per s", "completion", "late"} <= {row["figure"] for row in rows}
    assert all(0.0 <= float(row["mean"]) <= 1.0 for row in rows if row["figure"] == "completion")


def test_edges_are_one_option(tmp_path: Path) -> None:
    """Six drones on three edges are two on each; the sweep has it, too."""
    short = ("--edges", "3", "--seeds", "1", "--duration", "3", "-s", "edf", "--jobs", "1")
    code, text = _run("run", "-w", "2D-P", *short)
    assert code == 0, text
    assert "intervals over 3 edges" in text
    code, text = _run(
        *("sweep", "-w", "2D-P", *short, "--sweep", "models=P,A", "-o", str(tmp_path / "sweep"))
    )
    assert code == 0, text
    rows = list(csv.DictReader((tmp_path / "sweep" / "runs.csv").open(encoding="utf-8")))
    # A rate is the sum over the edges.
    assert float(rows[0]["qos per s"]) > 3 * 100


def test_the_list_names_what_there_is() -> None:
    """Schedulers with their idea, models with their figures."""
    code, text = _run("list")
    assert code == 0
    assert "margin" in text
    assert "DEO" in text


def test_mistakes_are_explained() -> None:
    """Exit status 2 and a sentence."""
    for arguments, words in (
        (("-s", "nope"), "no analytics scheduler is called 'nope'"),
        (("-w", "[/9Z]"), "no workload is called '[/9Z]'"),
        (("--network", "fog"), "no network is called 'fog'"),
        (("--times", "normal"), "nominal, lognormal or gamma"),
    ):
        wrong = ["run", "--seeds", "1", "--duration", "2", "--jobs", "1", *arguments]
        error = CliRunner().invoke(app, wrong).exception
        assert isinstance(error, AeroDaaSError)
        assert error.exit_code == 2
        assert words in str(error)

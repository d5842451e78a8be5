"""Sweeps of the lab: every combination, paired over the seeds, with tests that can be trusted."""

from __future__ import annotations

import csv
import itertools
import math
import re
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest
from matplotlib.axes import Axes
from typer.testing import CliRunner

from aerodaas.cli.lab.app import app
from aerodaas.cli.lab.sweep import parse_sweeps
from aerodaas.clock import NANOSECONDS
from aerodaas.config import extras
from aerodaas.errors import ConfigError, SchedulerError, UnknownIdError
from aerodaas.schedulers.analytics.published.edge_only import Edf
from aerodaas.schedulers.lab import Workload, run_lab, run_sweep
from aerodaas.schedulers.lab.metrics import holm, permutation_p
from aerodaas.schedulers.lab.network import Network
from aerodaas.schedulers.lab.plots import plot_sweep
from aerodaas.schedulers.lab.sweep import SweepResult
from aerodaas.schedulers.lab.workload import TaskArrival
from aerodaas.testing.scheduler_kit import check_scheduler

PAGE = Path(__file__).resolve().parents[3] / "docs" / "sweeps.md"
SETTINGS: dict[str, Any] = {"workload": "2D-P", "duration": 5.0, "jobs": 1}


class Slow(Edf):
    """One with a parameter of its own."""

    def __init__(self, pace: int = 1, *, kind: str = "a") -> None:
        super().__init__()
        if pace < 1:
            raise ValueError("no such pace")
        self.built = (pace, kind)

    def executor_idle(self, now: int) -> Any:  # noqa: ANN401
        """Run nothing at a pace of 2."""
        return super().executor_idle(now) if self.built[0] == 1 else []


@pytest.fixture(scope="module")
def result() -> SweepResult:
    """Two schedulers in four cases with three seeds."""
    sweep: dict[str, list[Any]] = {"drones": [1, 3], "network": ["steady", "outage"]}
    return run_sweep(["ec_edf", "fifo"], sweep, seeds=range(3), **SETTINGS)


def test_each_case_is_what_the_lab_simulates(result: SweepResult) -> None:
    """Every combination once, each with the figures of the very same run by itself."""
    assert [case for case, _ in result.cases] == [
        {"drones": drones, "network": network}
        for drones, network in itertools.product([1, 3], ["steady", "outage"])
    ]
    workload = Workload.named("3D-P", 5 * NANOSECONDS)
    network = Network.named("outage", workload.duration)
    alone = run_lab(workload, ["ec_edf", "fifo"], range(3), network=network, bound=False, jobs=1)
    rows = [row for row in result.rows if (row["drones"], row["network"]) == (3, "outage")]
    for name in ("ec_edf", "fifo"):
        own = [row["qos per s"] for row in rows if row["scheduler"] == name]
        assert own == alone.values(name)["qos per s"]
        assert [row["seed"] for row in rows if row["scheduler"] == name] == [0, 1, 2]
    assert len(result.rows) == 4 * 2 * 3


def test_the_summary_is_paired_and_corrected(result: SweepResult) -> None:
    """Differences seed by seed, and one correction over all comparisons of the figure."""
    rows = result.summary("completion")
    assert len(rows) == 8
    compared = [row for row in rows if row["scheduler"] == "fifo"]
    values = {
        (row["drones"], row["network"], row["scheduler"], row["seed"]): row["completion"]
        for row in result.rows
    }
    for row in compared:
        drones, network = row["drones"], row["network"]
        pairs = [
            values[drones, network, "fifo", seed] - values[drones, network, "ec_edf", seed]
            for seed in range(3)
        ]
        assert row["difference"] == pytest.approx(fmean(pairs))
        assert row["difference_low"] <= row["difference"] <= row["difference_high"]
        assert row["p"] == permutation_p(pairs)
        assert row["low"] <= row["mean"] <= row["high"]
    assert [row["p_holm"] for row in compared] == holm([row["p"] for row in compared])
    assert all(row["p"] is None for row in rows if row["scheduler"] == "ec_edf")
    assert not any(row["significant"] for row in compared)  # three seeds show nothing
    with pytest.raises(UnknownIdError, match="did you mean completion"):
        result.summary("completio")


def test_a_true_difference_is_found_and_none_is_made_up() -> None:
    """A scheduler that runs nothing is worse; one against itself differs by nothing."""
    sweep = run_sweep([Edf, Slow], {"scheduler.pace": [1, 2]}, seeds=range(8), **SETTINGS)
    same, worse = (row for row in sweep.summary("completion") if row["scheduler"] == "Slow")
    assert (same["difference"], same["p"], same["significant"]) == (0, 1, False)
    assert worse["difference_high"] < 0
    assert worse["p"] == 2 / 2**8
    assert worse["significant"]
    assert worse["mean"] == 0


@pytest.mark.parametrize(
    ("schedulers", "parameters", "words", "message"),
    [
        (["edf"], {}, {}, "needs a parameter"),
        (["edf"], {"drons": [1]}, {}, "did you mean drones"),
        (["edf"], {"drones": [1, 1]}, {}, "each once"),
        (["edf"], {"drones": []}, {}, "needs values"),
        (["edf"], {"scheduler.pace": [1]}, {}, "no scheduler of the sweep is built with 'pace'"),
        ([Slow], {"scheduler.kind": ["a"], "models": ["B"]}, {}, "no set of models is called 'B'"),
        (["edf"], {"drones": [1]}, {"baseline": "dems"}, "no scheduler of this sweep"),
        ([], {"drones": [1]}, {}, "at least one scheduler"),
        (["edf"], {"drones": [0]}, {}, "needs models, drones"),
        (["edf"], {"network": ["fog"]}, {}, "no network is called 'fog'"),
    ],
)
def test_what_cannot_be_swept_is_refused_before_it_runs(
    schedulers: list[Any],
    parameters: dict[str, list[Any]],
    words: dict[str, Any],
    message: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the remedy, and no case is simulated."""
    monkeypatch.setattr("aerodaas.schedulers.lab.sweep.run_lab", None)
    with pytest.raises((SchedulerError, UnknownIdError), match=message):
        run_sweep(schedulers, parameters, **{**SETTINGS, **words})


def test_listed_tasks_keep_their_drones() -> None:
    """A recorded workload has its own; the network may change."""
    models = Workload.named("2D-P").models
    listed = Workload(
        "flown", models, duration=NANOSECONDS, arrivals=(TaskArrival(0, next(iter(models))),)
    )
    with pytest.raises(SchedulerError, match="lists its tasks"):
        run_sweep(["edf"], {"drones": [2]}, workload=listed, seeds=[0], jobs=1)
    swept = run_sweep(["edf"], {"cloud_slots": [0, 4]}, workload=listed, seeds=[0], jobs=1)
    assert len(swept.rows) == 2
    assert all(math.isnan(row["high"]) for row in swept.summary("late"))


def test_a_parameter_that_a_constructor_refuses_is_told() -> None:
    """By its value."""
    with pytest.raises(SchedulerError, match=r"cannot be built with .'pace': 0.: no such pace"):
        run_sweep([Slow], {"scheduler.pace": [0]}, seeds=[0], **SETTINGS)


def test_p_is_that_of_all_signs() -> None:
    """Counted by hand for three seeds; as rare as can be for differences of one sign."""
    differences = [1.0, 2.0, -0.5]
    observed = abs(sum(differences))
    sums = [
        abs(sum(sign * one for sign, one in zip(signs, differences, strict=True)))
        for signs in itertools.product((1, -1), repeat=3)
    ]
    assert permutation_p(differences) == sum(one >= observed - 1e-12 for one in sums) / 8
    assert permutation_p([0.1] * 10) == 2 / 2**10
    assert permutation_p([0.1] * 20) == 1 / 20_001
    assert permutation_p([0.0] * 5) == permutation_p([0.0] * 30) == 1
    assert permutation_p([0.1, 0.2, -0.3]) == 1
    assert math.isnan(permutation_p([1.0]))


def test_holm_corrects_step_by_step() -> None:
    """Holm's own procedure: the smallest by the number of all, never falling, at most one."""
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.9]) == [1.0, 1.0]
    assert holm([]) == []
    corrected = holm([math.nan, 0.02])
    assert math.isnan(corrected[0])
    assert corrected[1] == 0.02


def test_sweeps_are_read() -> None:
    """Numbers, words with commas of their own, and the same parameter twice."""
    read = parse_sweeps(
        ["drones=1, 2", "network=steady,outage:30-45,80-81,trapezium:300", "drones=4"]
    )
    assert read == {
        "drones": [1, 2, 4],
        "network": ["steady", "outage:30-45,80-81", "trapezium:300"],
    }
    own = parse_sweeps(["scheduler.slack=10,0.5,fast", "duration=2"])
    assert own == {"scheduler.slack": [10, 0.5, "fast"], "duration": [2.0]}
    assert isinstance(own["scheduler.slack"][0], int)
    for text, message in (
        ("drones", "is written drones=10"),
        ("drones=", "is written drones=10"),
        ("drones=few", "takes whole numbers"),
        ("duration=long", "takes numbers"),
    ):
        with pytest.raises(ConfigError, match=message):
            parse_sweeps([text])
    with pytest.raises(UnknownIdError, match="did you mean edges"):
        parse_sweeps(["edge=1"])


def run(*words: str) -> tuple[int, str]:
    """The command."""
    outcome = CliRunner().invoke(
        app, ["sweep", *words], env={"COLUMNS": "100"}, catch_exceptions=False
    )
    return outcome.exit_code, outcome.output


def test_the_command_writes_tables_and_plots(tmp_path: Path) -> None:
    """One row for each run; what is significant is marked; too few seeds are told."""
    out = tmp_path / "study"
    words = ("--sweep", "drones=2,4", "-w", "2D-P", "-s", "ec_edf,fifo", "--duration", "5")
    code, text = run(*words, "--seeds", "8", "--jobs", "1", "-o", str(out), "-f", "completion")
    assert code == 0, text
    assert re.search(r"drones=4\s+fifo .*less|less ec_edf", text)
    assert "0.0156 *" in text
    assert "can be significant" not in text
    rows = list(csv.DictReader((out / "runs.csv").open(encoding="utf-8")))
    assert len(rows) == 2 * 2 * 8
    assert set(rows[0]) > {"drones", "scheduler", "seed", "completion", "qos per s"}
    summary = list(csv.DictReader((out / "summary.csv").open(encoding="utf-8")))
    assert {row["figure"] for row in summary} > {"completion", "qos per s", "late"}
    from pyarrow import parquet  # noqa: PLC0415 - an extra

    assert parquet.read_table(out / "runs.parquet").num_rows == len(rows)
    assert (out / "completion.pdf").read_bytes().startswith(b"%PDF")
    assert (out / "completion.png").stat().st_size > 5_000
    code, text = run(*words, "--seeds", "2", "--jobs", "1", "-o", str(out))
    assert "none of 2 comparisons can be significant: take --seeds 7" in " ".join(text.split())
    assert (out / "qos_per_s.png").exists()


def test_the_command_explains_mistakes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit status 2 and a sentence; without Matplotlib the tables are written all the same."""
    with pytest.raises(UnknownIdError):
        run("--sweep", "drons=1")
    blocked = tmp_path / "file"
    blocked.write_text("mine")
    words = ("--sweep", "drones=1", "-s", "edf", "--duration", "2", "--seeds", "1", "--jobs", "1")
    with pytest.raises(ConfigError, match="cannot write into"):
        run(*words, "-o", str(blocked))
    monkeypatch.setattr("aerodaas.cli.lab.sweep.has_extra", lambda _: False)
    code, text = run(*words, "-o", str(tmp_path / "out"))
    assert (code, "pip install 'aerodaas[plots]'" in text) == (0, True)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "runs.csv", "runs.parquet", "summary.csv",
    ]  # fmt: skip
    assert extras.has_extra("plots")


def test_words_are_bars_and_numbers_lines(
    result: SweepResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over the parameter with the most numbers; one panel for each case of the others."""
    bars: list[object] = []
    draw = Axes.bar
    monkeypatch.setattr(Axes, "bar", lambda *a, **k: bars.append(a) or draw(*a, **k))  # type: ignore[func-returns-value]
    plot_sweep(result, "completion", tmp_path / "lines.png")
    assert not bars
    sweep: dict[str, list[Any]] = {"network": ["steady", "trapezium"], "models": ["A", "P"]}
    words = run_sweep(["edf", "fifo"], sweep, seeds=range(2), **SETTINGS)
    plot_sweep(words, "qos per s", tmp_path / "bars.png")
    assert len(bars) == 2 * 2
    assert {path.stat().st_size > 5_000 for path in tmp_path.iterdir()} == {True}


def test_the_page_does_what_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The class keeps the protocol, and the sweep prints significant differences."""
    text = PAGE.read_text(encoding="utf-8")
    scheduler, check, sweep = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    Path("patient.py").write_text(scheduler)
    exec(check, {})  # noqa: S102 - our own page
    exec(sweep, {})  # noqa: S102 - our own page
    printed = capsys.readouterr().out.splitlines()
    assert printed
    assert all(re.fullmatch(r"[24] \w+ \S+ [+-]\d+ to [+-]\d+", line) for line in printed)
    assert any("patient.py:Patient" in line for line in printed)
    check_scheduler("patient.py:Patient")

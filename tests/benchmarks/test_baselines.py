"""The programs without AeroDaaS fly, are judged by where they truly were, and are counted."""

from __future__ import annotations

import ast
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from bench_runs import run_benchmark

ROOT = Path(__file__).parents[2]
sys.path.append(str(ROOT / "benchmarks"))

from lines_of_code import figures, modules, together  # noqa: E402 - benchmarks are no package
from missions.catalogue import MISSIONS  # noqa: E402
from missions.plain import BASELINES, fly  # noqa: E402


@pytest.mark.slow
@pytest.mark.wall_clock
def test_the_farm_survey_flies_by_pymavlink() -> None:
    """On an emulated ArduCopter, five times as fast, by the criteria of the application."""
    words = ("--only", "farm_survey_pymavlink", "--pace", "5")
    done = run_benchmark("fly_baselines", *words)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("  ok ") == len(MISSIONS["farm_survey"].criteria)


def test_words_alone_meet_no_criterion(tmp_path: Path) -> None:
    """A program that says that it flew, and did not, is found out by the vehicle's truth."""
    farm = replace(BASELINES["farm_survey_pymavlink"], folder=tmp_path)
    legs = "".join(f"print('enroute wp{one}\\nloitering wp{one}')\n" for one in (1, 2, 3, 4))
    ends = "print('returning\\nlanding\\nlanded')\n"
    farm.script.write_text(f"import time\ntime.sleep(0.3)\nprint('taking_off')\n{legs}{ends}")
    flight = fly(farm, tmp_path / "flight")
    holds = {check.what: check.holds for check in flight.judge("farm_survey")}
    assert flight.code == 0
    assert not holds["reached within 0.5 m: wp1, wp2, wp3, wp4"]
    assert next(held for what, held in holds.items() if what.startswith("states"))


def test_each_application_has_a_baseline() -> None:
    """All six, and none imports anything of ours but its neighbours."""
    assert {one.mission for one in BASELINES.values()} == set(MISSIONS)
    for one in BASELINES.values():
        for path in modules(one.script):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            names = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
            assert not [name for name in names if name and name.startswith("aerodaas")], path


def test_a_module_that_several_import_counts_once() -> None:
    """What two programs share is in the sum of both a single time, and in each alone."""
    farm, disaster = BASELINES["farm_survey_pymavlink"], BASELINES["disaster_survey_pymavlink"]
    copter = farm.script.with_name("ardupilot_copter.py")
    assert copter in modules(farm.script) & modules(disaster.script)
    alone = [figures(one)["theirs"] for one in (farm, disaster)]
    both = together([farm, disaster])["theirs"]
    assert max(alone) < both < sum(alone)


def test_the_documentation_has_the_counts() -> None:
    """The page's table says what is counted today."""
    page = (ROOT / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    row = re.compile(r"^\| `(\w+)` \| (\d+ \| \d+ \| \d+ \| \d+) \|", re.MULTILINE)
    rows = dict(row.findall(page))
    assert rows
    columns = ("ours", "theirs", "networks", "own file")
    for name, numbers in rows.items():
        found = figures(BASELINES[name])
        assert [int(one) for one in numbers.split(" | ")] == [found[one] for one in columns], name

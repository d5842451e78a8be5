"""The page that teaches writing a scheduler tells the truth."""

from __future__ import annotations

import re
from pathlib import Path

from aerodaas.schedulers.lab import Workload, run_lab
from aerodaas.testing.scheduler_kit import check_scheduler

PAGE = Path(__file__).parents[3] / "docs" / "schedulers.md"


def test_the_scheduler_on_the_page_works(tmp_path: Path) -> None:
    """It is short, passes the kit, and is of use: it beats EDF on the edge alone."""
    found = re.search(r"```python\n(# mine.py\n.*?)```", PAGE.read_text(), re.DOTALL)
    assert found is not None
    assert len(found[1].splitlines()) <= 35
    mine = tmp_path / "mine.py"
    mine.write_text(found[1])
    check_scheduler(f"{mine}:Mine", seconds=8)
    workload = Workload.named("3D-A", 20_000_000_000)
    result = run_lab(workload, ["edf", f"{mine}:Mine"], [0], bound=False, jobs=1)
    ours, edf = (result.figures(name)["qos per s"].value for name in (f"{mine}:Mine", "edf"))
    assert ours > 1.3 * edf

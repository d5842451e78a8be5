"""The benchmark of meetings flies with the guard and without, and draws one."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from bench_runs import run_benchmark


@pytest.mark.slow
def test_a_meeting_is_measured_and_drawn(tmp_path: Path) -> None:
    """Contact without the guard, none with it; both in one run of the same seeds."""
    path, picture = tmp_path / "meetings.json", tmp_path / "meeting.png"
    words = ["--speeds", "1.0", "--rates", "10", "--seeds", "1", "--first-seed", "2"]
    done = run_benchmark("meetings", *words, "--json", str(path), "--picture", str(picture))
    assert done.returncode == 0, done.stderr
    rows = {row["case"]: row for row in json.loads(path.read_text())["rows"]}
    assert rows["1.0 m/s, 10 Hz, without"]["contact"] == 1
    assert rows["1.0 m/s, 10 Hz, with the guard"]["contact"] == 0
    assert rows["1.0 m/s, 10 Hz, with the guard"]["told"] == 1
    assert picture.read_bytes().startswith(b"\x89PNG")

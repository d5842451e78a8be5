"""Commands about mission documents: `check` of one, its schema, and the application from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from command_line import ran
from flying import FLAT

DOCUMENT: dict[str, Any] = {
    "format": "aerodaas-mission",
    "version": 1,
    "environment": "environment.json",
    "navigation": [
        {
            "robot": "drone",
            "waypoints": [{"id": "a", "x": 5, "y": 0, "z": 2}, {"id": "b", "x": 5, "y": 5, "z": 2}],
        }
    ],
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with an environment and a document."""
    monkeypatch.chdir(tmp_path)
    Path("environment.json").write_text(json.dumps(FLAT))
    Path("mission.json").write_text(json.dumps(DOCUMENT))
    return tmp_path


def test_a_good_document_is_told_its_way(capsys: pytest.CaptureFixture[str]) -> None:
    """The forecast of the robot, and exit code 0."""
    code, out, _ = ran(capsys, "check", "mission.json")
    assert code == 0
    assert "drone" in out
    assert "nothing found" in out


@pytest.mark.parametrize(
    ("changes", "check", "told"),
    [
        ({"navigation": [{"robot": "dron", "waypoints": []}]}, "unknown_name", "drone"),
        (
            {
                "analyses": [
                    {
                        "id": "drone/it",
                        "analysis": "MonitoringAnalytics",
                        "settings": {"readings": ["batery"]},
                        "reads": ["drone/odom_drone"],
                    }
                ],
                "sensors": ["drone/odom_drone"],
            },
            "document",
            "battery",
        ),
    ],
)
def test_a_bad_document_has_its_findings(
    capsys: pytest.CaptureFixture[str], changes: dict[str, Any], check: str, told: str
) -> None:
    """By name, and by what only the making of an analysis tells; exit code 1."""
    Path("mission.json").write_text(json.dumps({**DOCUMENT, **changes}))
    code, out, _ = ran(capsys, "check", "mission.json")
    assert code == 1
    assert told in out
    code, out, _ = ran(capsys, "check", "mission.json", "--env", "environment.json", "--json")
    report = json.loads(out)
    assert code == 1
    assert not report["passed"]
    assert report["findings"][0]["check"] == check

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


def test_a_document_becomes_an_application_that_compiles_to_it(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """In another folder, with the environment that lies beside the document."""
    Path("written").mkdir()
    code, out, _ = ran(capsys, "new", "--from-document", "mission.json", "-o", "written/patrol.py")
    assert code == 0
    assert "aerodaas run written/patrol.py" in out
    code, out, _ = ran(capsys, "compile", "written/patrol.py")
    assert json.loads(out) == {**DOCUMENT, "name": "patrol"}


@pytest.mark.parametrize(
    "words",
    [
        ["new"],
        ["new", "patrol", "--from-document", "mission.json"],
        ["new", "--from-document", "none.json"],
        ["new", "--from-document", "mission.json", "-o", "environment.json"],
    ],
)
def test_what_cannot_be_written_is_refused(
    capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    """Without a name, with two of them, without a document, and over a file that is there."""
    code, _, said = ran(capsys, *words)
    assert code == 2
    assert said
    assert json.loads(Path("environment.json").read_text()) == FLAT


def test_the_schema_of_documents_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    """As JSON, with the analyses that are installed."""
    code, out, _ = ran(capsys, "schema", "--document")
    assert code == 0
    assert "distance" in json.loads(out)["$defs"]["PersonFollowAnalytics"]["properties"]

"""What is missing skips a test where somebody works, with the remedy, and fails it in CI."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
TESTS = """
import pytest
from required import needs, needs_peer, needs_python

@needs(False, "install it")
def test_needs(): pass

@needs(True, "install it")
def test_has(): pass

def test_skips():
    pytest.skip("in the middle")

@needs_peer("AERODAAS_MAVSDK")
def test_of_a_peer(): pass

@needs_peer("AERODAAS_MAVSDK")
def test_of_a_peer_that_skips():
    pytest.skip("named, but its model is missing")

@needs_python(9, 9, because="of a library")
def test_of_the_future(): pass

@needs_python(3, 9, because="of a library")
def test_of_today(): pass

@pytest.mark.xfail(reason="known")
def test_known():
    assert False
"""
MODULE = """
import pytest
pytest.importorskip("there_is_no_such_module", reason="pip install it")
"""


def run(folder: Path, **variables: str) -> str:
    """What pytest says of the tests above, a line for each reason."""
    (folder / "test_it.py").write_text(TESTS)
    (folder / "test_module.py").write_text(MODULE)
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST")}
    for name in ("CI", "AERODAAS_MAVSDK"):
        env.pop(name, None)
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "required", "-p", "no:cacheprovider", "-rA", "."],
        cwd=folder,
        env={**env, "PYTHONPATH": str(HERE), "COLUMNS": "200", **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    return ended.stdout


def test_where_somebody_works_it_skips_and_says_why(tmp_path: Path) -> None:
    """Each reason is a remedy."""
    said = run(tmp_path)
    assert "2 passed, 6 skipped, 1 xfailed" in said
    for reason in ("install it", "pip install it", "set AERODAAS_MAVSDK to", "needs Python 9.9"):
        assert reason in said


def test_in_continuous_integration_only_peers_and_newer_pythons_stay_out(tmp_path: Path) -> None:
    """A skip of a module stops the run, as any module that cannot be read does."""
    said = run(tmp_path, CI="1")
    assert "error" in said.splitlines()[-1]
    assert "missing, in continuous integration: Skipped: pip install it" in said
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --ignore test_module.py\n")
    said = run(tmp_path, CI="1")
    assert "1 failed, 2 passed, 3 skipped, 1 xfailed, 1 error" in said
    assert "missing, in continuous integration: Skipped: install it" in said
    assert "missing, in continuous integration: Skipped: in the middle" in said


def test_a_peer_that_is_named_must_run(tmp_path: Path) -> None:
    """What its variable names is no longer free to stay out."""
    (tmp_path / "pytest.ini").write_text("[pytest]\naddopts = --ignore test_module.py\n")
    said = run(tmp_path, CI="1", AERODAAS_MAVSDK=sys.executable)
    assert "2 failed, 3 passed, 1 skipped, 1 xfailed, 1 error" in said
    assert "named, but its model is missing" in said


def test_a_peer_must_be_known() -> None:
    """What may stay out stands in one place."""
    from required import needs_peer  # noqa: PLC0415 - in pytest's own hands until now

    with pytest.raises(AssertionError):
        needs_peer("AERODAAS_SOMETHING")

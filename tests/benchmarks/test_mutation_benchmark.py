"""The mutation benchmark tells what a test would notice from what none does."""

from __future__ import annotations

from pathlib import Path

import pytest
from bench_runs import run_benchmark

CODE = '''"""Ages."""


def is_adult(age: int) -> bool:
    """Grown up."""
    return age >= 18


class Pair:
    """Two numbers."""

    def larger(self, a: int, b: int) -> int:
        """Of two."""
        return a if a > b else b

    def total(self, a: int, b: int) -> int:
        """Sum, which no test asks for."""
        return a + b
'''
TEST = """from toy.parts.ages import Pair, is_adult


def test_far_from_the_edge():
    assert is_adult(40)
    assert not is_adult(2)


def test_larger():
    assert Pair().larger(3, 2) == 3
    assert Pair().larger(2, 3) == 3
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A package with a linked folder, and tests that miss a boundary and a method."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "__init__.py").touch()
    (tmp_path / "parts" / "ages.py").write_text(CODE, encoding="utf-8")
    (tmp_path / "toy").mkdir()
    (tmp_path / "toy" / "__init__.py").touch()
    (tmp_path / "toy" / "parts").symlink_to("../parts")
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "test_people.py").write_text(TEST, encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_a_survivor_is_told_from_the_killed(project: Path) -> None:
    """By its line in the file and by what changed; no trace of the run stays."""
    before = sorted(project.rglob("*"))
    source = project / "parts" / "ages.py"
    done = run_benchmark("mutation", str(source), "--root", str(project))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "toy/parts/ages.py:6: survived\n- return age >= 18\n+ return age > 18\n" in done.stdout
    assert "toy/parts/ages.py:6: survived\n- return age >= 18\n+ return age >= 19\n" in done.stdout
    assert "toy/parts/ages.py:18: untested\n- return a + b\n+ return a - b\n" in done.stdout
    row = next(
        line for line in done.stdout.splitlines() if line.split()[:1] == ["toy/parts/ages.py"]
    )
    assert row.split()[1:] == ["6", "2", "3", "1", "33.3"]
    assert "+ return a if a < b" not in done.stdout
    assert sorted(project.rglob("*")) == before
